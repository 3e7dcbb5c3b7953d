"""What a session is subscribed to at its broker, whatever the vehicle and the network do meanwhile."""

from typing import Any, cast

from drivers.message import Ego
from drivers.mqtt_session import Phase
from drivers.mqtt_window import Accepted
from drivers.wire.v2n import Profile
from tests.drivers.mqtt_model import Bench


class Latitude:
    """A profile whose one subscription is the latitude."""

    def subscriptions(self, own: Ego) -> frozenset[tuple[str, int]]:
        return frozenset({(str(own.position.latitude), 1)})

    def connected(self) -> None:
        return None

    closing = lost = connected


def moving(**how: Any) -> Bench:
    return Bench(profile=cast(Profile, Latitude()), **how)


def connect(bench: Bench, is_resumed: bool = False) -> None:
    bench.session.connected(Accepted(is_resumed=is_resumed), bench.now)


def lose(bench: Bench) -> None:
    bench.session.lost("gone", bench.now)
    bench.run(60.0, lambda: bench.session.phase is Phase.CONNECTING)


def settle(bench: Bench, held: set[str]) -> None:
    """The broker answers what it was asked; held is what it delivers."""
    client, session = bench.client, bench.session
    while owed := session._subscriptions.awaits():
        if owed[0] == "SUBACK":
            held |= {name for name, _ in client.subscribes[-1]}
            session.subscribed({}, bench.now)
        else:
            held -= set(client.unsubscribes[-1])
            session.unsubscribed(bench.now)


def test_a_vehicle_that_moves_before_its_first_suback_comes_up():
    bench = moving()
    connect(bench)
    bench.move(7)
    bench.run(1.0)
    held: set[str] = set()
    settle(bench, held)
    assert (held, bench.is_up) == ({"7"}, True)


def test_a_vehicle_that_wants_nothing_any_more_comes_up_too():
    class Nowhere(Latitude):
        def subscriptions(self, own: Ego) -> frozenset[tuple[str, int]]:
            return super().subscriptions(own) if own.position.latitude else frozenset()

    bench = Bench(profile=cast(Profile, Nowhere()))
    connect(bench)
    assert bench.is_up
