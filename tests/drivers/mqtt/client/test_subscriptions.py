"""Subscriptions of a session while vehicle and network change."""

from typing import Any, cast

import pytest

from drivers.message import Ego
from drivers.mqtt.client.session import Phase
from drivers.mqtt.client.subscriptions import REFUSED_S
from drivers.mqtt.client.window import Accepted
from drivers.wire.v2n.profile import Profile
from tests.drivers.mqtt.model import URL, Bench, tiles


class Latitude:
    """Profile with a single subscription, whose topic is the latitude."""

    def subscriptions(self, own: Ego) -> frozenset[tuple[str, int]]:
        return frozenset({(str(own.position.latitude), 1)})

    def lacks(self, own: Ego) -> tuple[bool, str]:
        return False, ""

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
    """Make the broker answer all subscribe and unsubscribe packets. held: topics that it has subscribed."""
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


def test_each_connection_subscribes_anew():
    bench = Bench().accept()
    bench.session.lost("gone", bench.now)
    bench.run(2.0)
    bench.accept()
    assert bench.client.subscribes == [[("v2x/+", 1)]] * 2


@pytest.mark.parametrize("owed", ["SUBACK", "UNSUBACK"])
def test_what_a_lost_connection_owed_does_not_keep_the_next_from_subscribing(owed):
    bench = tiles().accept()
    bench.move(3)
    bench.run(1.0)
    if owed == "UNSUBACK":
        bench.session.subscribed({}, bench.now)
    bench.session.lost("gone", bench.now)
    bench.run(2.0)
    bench.accept()
    assert bench.client.subscribes[-1] == [("3", 1), ("all", 0)]
    assert bench.is_up


def test_what_one_connection_refused_the_next_is_asked_for():
    bench = Bench()
    bench.session.connected(Accepted(), bench.now)
    bench.session.subscribed({"v2x/+": "Not authorized"}, bench.now)
    bench.session.lost("gone", bench.now)
    bench.run(2.0)
    bench.accept()
    assert bench.client.subscribes == [[("v2x/+", 1)]] * 2
    assert bench.states[-1] == (True, f"{URL}: connected")


def test_a_refused_tile_that_was_left_is_not_told_any_more():
    bench = tiles()
    bench.session.connected(Accepted(), bench.now)
    bench.session.subscribed({"0": "Not authorized"}, bench.now)
    assert "refuses subscription 0" in bench.states[-1][1]
    bench.move(3)
    bench.run(1.0)
    bench.session.subscribed({}, bench.now)
    assert bench.states[-1] == (True, f"{URL}: connected")


def test_what_is_new_is_subscribed_before_what_is_old_is_left():
    bench = tiles().accept()
    bench.move(7)
    bench.run(1.0)
    assert bench.client.subscribes[1:] == [[("7", 1)]]
    assert bench.client.unsubscribes == []
    bench.session.subscribed({}, bench.now)
    assert bench.client.unsubscribes == [["0"]]
    bench.session.unsubscribed(bench.now)
    assert bench.client.subscribes[2:] == []


def test_a_vehicle_that_goes_to_and_fro_at_an_edge_costs_no_packet():
    bench = tiles()
    bench.move(0)
    bench.accept()
    for _ in range(3):
        bench.move(7)
        bench.run(0.3)
        bench.move(0)
        bench.run(0.8)
    assert (len(bench.client.subscribes), bench.client.unsubscribes) == (1, [])


def test_a_vehicle_that_moves_on_meanwhile_ends_with_what_it_wants_last():
    bench = tiles().accept()
    held = {"0", "all"}
    for latitude in range(1, 20):
        bench.move(latitude)
        bench.run(0.3)
        if latitude % 4 == 0:  # the broker is slow
            settle(bench, held)
    bench.run(5.0, lambda: settle(bench, held) and False)
    settle(bench, held)
    assert held == {"19", "all"}
    assert len(bench.client.subscribes) < 12  # and not each move has cost a packet


def test_a_refused_subscription_leaves_the_link_up_and_says_so():
    bench = Bench()
    bench.session.connected(Accepted(), bench.now)
    bench.session.subscribed({"v2x/+": "Not authorized"}, bench.now)
    assert bench.states[-1] == (True, f"{URL}: connected, but refuses subscription v2x/+: Not authorized")
    bench.send()
    assert bench.topics == ["v2x/cam"]


def test_a_refused_subscription_is_asked_for_once_a_minute():
    bench = Bench()
    bench.session.connected(Accepted(), bench.now)
    for asked in range(1, 4):
        bench.session.subscribed({"v2x/+": "Not authorized"}, bench.now)
        bench.run(REFUSED_S - 1.5)
        assert len(bench.client.subscribes) == asked
        bench.run(2.5)
        assert len(bench.client.subscribes) == asked + 1
    bench.session.subscribed({}, bench.now)
    assert bench.states[-1] == (True, f"{URL}: connected")


@pytest.mark.parametrize("is_first", [True, False])
def test_a_broker_without_a_suback_is_given_up(is_first):
    bench = tiles(connect_s=7.0)
    if is_first:
        bench.session.connected(Accepted(), bench.now)
    else:
        bench.accept()
        bench.move(3)
        bench.run(1.0)
    bench.run(7.1)
    assert bench.states[-1] == (False, f"{URL}: no SUBACK within 7 s")
    assert bench.client.calls[1] == "drop"


def test_a_broker_without_an_unsuback_is_given_up():
    bench = tiles(connect_s=7.0).accept()
    bench.move(3)
    bench.run(1.0)
    bench.session.subscribed({}, bench.now)
    bench.run(7.1)
    assert bench.states[-1][1] == f"{URL}: no UNSUBACK within 7 s"
