"""Attacks by topics and subscriptions: only the attacker is ended, and each end is counted."""

from contextlib import suppress

import pytest

from drivers.reason import Reason
from firmware.endpoint.peers.limits import (
    TOPIC,
    TOPICS_LOCAL,
)
from tests.cases.endpoint_bench import Bench, bench, flood
from tests.hostile import OldPeer

__all__ = ["bench"]  # a fixture


@pytest.mark.parametrize("octets", [TOPIC + 1, 900])
def test_a_topic_that_is_too_long_ends_its_connection_and_is_counted(bench: Bench, octets: int) -> None:
    rude = bench.peer()
    rude.subscribe(b"x" * octets)
    bench.until(lambda: bench.count("to_users", Reason.TOPICS) == 1)
    bench.until(rude.is_cut)
    assert f"topic of {octets} octets; at most 256" in str(next(bench.drops.status())["detail"])


def test_a_topic_of_256_octets_is_taken(bench: Bench) -> None:
    good = bench.peer()
    good.subscribe(b"v2x.".ljust(TOPIC, b"x"))
    bench.until(lambda: bench.wanted == {b"v2x.": True})
    assert not good.is_cut()


def test_a_giant_topic_never_gets_into_the_socket(bench: Bench) -> None:
    rude = bench.peer()
    rude.socket.sendall(b"\2" + (16 << 20).to_bytes(8, "big") + b"\1" + bytes(5000))
    bench.until(rude.is_cut)
    assert bench.wanted == {}


def test_of_an_address_with_too_many_topics_the_largest_subscriber_is_ended(bench: Bench) -> None:
    good, rude = bench.peer(), bench.peer()
    good.subscribe(b"v2x.cam.")
    bench.until(lambda: bench.wanted == {b"v2x.": True})
    for number in range(TOPICS_LOCAL):
        rude.subscribe(b"%d" % number)
    bench.until(lambda: bench.count("to_users", Reason.TOPICS) == 1)
    bench.until(rude.is_cut)
    assert not good.is_cut()
    bench.publisher.publish(b"v2x.cam.", b"pdu")
    bench.until(lambda: b"pdu" in good.read())
    assert "513 topics of this address; at most 512" in str(next(bench.drops.status())["detail"])


def test_of_zmtp_2_with_too_many_topics_the_largest_subscriber_is_ended(bench: Bench) -> None:
    good, new, rude = bench.peer(of=OldPeer), bench.peer(), bench.peer(of=OldPeer)
    for one in (good, new):
        one.subscribe(b"v2x.cam.")
    bench.until(lambda: bench.publisher._interest.total == 1)
    for number in range(TOPICS_LOCAL + 1):
        rude.subscribe(b"%d" % number)
    bench.until(lambda: bench.count("to_users", Reason.TOPICS) == 1)
    bench.until(rude.is_cut)
    assert not new.is_cut()
    assert not good.is_cut()
    bench.publisher.publish(b"v2x.cam.", b"pdu")
    bench.until(lambda: b"pdu" in good.read())


def test_an_address_outside_has_32_topics(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("firmware.endpoint.peers.connection.LOCAL", ("192.0.2.",))
    first, second = bench.peer(), bench.peer()
    for number in range(32):
        first.subscribe(b"v2x.%d" % number)
    bench.until(lambda: bench.publisher._interest.total == 32)
    second.subscribe(b"v2x.")
    bench.until(lambda: bench.count("to_users", Reason.TOPICS) == 1)
    assert "33 topics of this address; at most 32" in str(next(bench.drops.status())["detail"])


def test_topics_of_all_together_are_limited(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("firmware.endpoint.publisher.TOPICS_TOTAL", 20)
    good, rude = bench.peer(), bench.peer()
    good.subscribe(b"v2x.")
    for number in range(20):
        rude.subscribe(b"%d" % number)
    bench.until(lambda: bench.count("to_users", Reason.TOPICS) == 1)
    bench.until(rude.is_cut)
    assert not good.is_cut()


@pytest.mark.parametrize("first", [b"\1", b"\0", b"x"])
def test_a_subscriber_that_sends_without_end_is_ended_by_a_thread(bench: Bench, first: bytes) -> None:
    good, rude = bench.peer(), bench.peer()
    good.subscribe(b"v2x.")
    bench.until(lambda: bench.wanted == {b"v2x.": True})
    flood(bench, rude, first)
    bench.until(rude.is_ended)
    assert not good.is_cut()
    bench.publisher.publish(b"v2x.cam.", b"pdu")
    bench.until(lambda: b"pdu" in good.read())


def test_heartbeats_of_an_hour_do_not_end_a_subscriber_whose_address_has_sent_too_much(bench: Bench) -> None:
    good, rude = bench.peer(), bench.peer()
    good.subscribe(b"v2x.")
    bench.until(lambda: bench.wanted == {b"v2x.": True})
    one = next(one for one in bench.publisher.door.connections.values() if one.topics)
    heartbeat = b"\4\x12\4PING\0\0" + bytes(11)
    good.socket.sendall(heartbeat * 500)
    bench.until(lambda: one.read() > 500 * len(heartbeat))
    bench.guard._flood._watched[one.fileno()].since -= 3600.0
    flood(bench, rude, b"\1")
    before = one.read()
    good.socket.sendall(heartbeat * 10)
    bench.until(lambda: one.read() > before)
    bench.until(rude.is_ended)
    assert not good.is_cut()
    assert bench.count("to_users", Reason.SUBSCRIBER_FLOOD) == 1


def test_beside_a_flood_of_their_address_small_subscribers_stay_and_others_are_ended(bench: Bench) -> None:
    rude, small, large = bench.peer(), bench.peer(), bench.peer()
    flood(bench, rude, b"x")
    for number in range(25):
        small.subscribe(b"v2x.denm.%02d." % number)
    bench.until(lambda: bench.publisher._interest.total == 25)
    with suppress(OSError):
        for number in range(8):
            large.subscribe(b"%d" % number + bytes(200))
    bench.until(lambda: bench.count("to_users", Reason.SUBSCRIBER_FLOOD) == 2)
    bench.until(large.is_ended)
    assert not small.is_cut()


def test_heartbeats_do_not_use_up_what_subscribers_of_an_address_may_send(bench: Bench) -> None:
    peers = [bench.peer() for _ in range(2)]
    bench.until(lambda: bench.open() == 2)
    flood_watch = bench.guard._flood
    for one in bench.publisher.door.connections.values():
        flood_watch._watched[one.fileno()].since -= 3600.0
    for peer in peers:
        for _ in range(100):  # 220 kB
            peer.socket.sendall((b"\4\x12\4PING\0\0" + bytes(11)) * 50)
            bench.loop.run_for(0.01)
    peers[0].subscribe(b"v2x.".ljust(TOPIC, b"x"))
    bench.until(lambda: bench.wanted == {b"v2x.": True})
    assert flood_watch._levels["127.0.0.1"][0] > 0
    assert not any(peer.is_cut() for peer in peers)


def test_a_subscriber_that_sends_heartbeats_and_topics_within_its_allowance_stays(bench: Bench) -> None:
    good = bench.peer()
    for number in range(TOPICS_LOCAL - 1):
        good.subscribe(b"v2x.%d." % number + bytes(100))
    for _ in range(1000):
        good.socket.sendall(b"\4\x12\4PING\0\0" + bytes(11))
    bench.until(lambda: bench.publisher._interest.total == TOPICS_LOCAL - 1)
    bench.until(lambda: next(iter(bench.publisher.door.connections.values())).read() > 1000 * 20)
    assert not good.is_cut()
    assert list(bench.drops.status()) == []
