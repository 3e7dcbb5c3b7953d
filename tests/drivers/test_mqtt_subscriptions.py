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


def test_a_tile_that_was_being_left_is_asked_for_again_after_a_resumption():
    bench = moving(clean=False).accept()
    bench.move(7)
    bench.run(1.0)
    bench.session.subscribed({}, bench.now)
    assert bench.client.unsubscribes == [["0"]]
    bench.move(0)
    lose(bench)  # the broker has left it, and its UNSUBACK is lost
    held = {"7"}
    connect(bench, is_resumed=True)
    settle(bench, held)
    assert (held, bench.is_up) == ({"0"}, True)


def test_a_tile_whose_suback_was_lost_is_left_after_a_resumption():
    bench = moving(clean=False).accept()
    bench.move(7)
    bench.run(1.0)
    bench.move(9)
    lose(bench)
    held = {"0", "7"}
    connect(bench, is_resumed=True)
    settle(bench, held)
    assert (held, bench.is_up) == ({"9"}, True)


def test_what_two_lost_connections_have_left_in_doubt_is_left_by_the_third():
    bench = moving(clean=False).accept()
    for latitude in (7, 9):
        bench.move(latitude)
        bench.run(1.0)
        lose(bench)
        connect(bench, is_resumed=True)
    held = {"0", "7"}
    settle(bench, held)
    assert held == {"9"}


def test_a_session_that_the_broker_has_not_kept_leaves_nothing():
    bench = moving().accept()
    bench.move(7)
    lose(bench)
    connect(bench)
    settle(bench, set())
    assert bench.client.unsubscribes == []
