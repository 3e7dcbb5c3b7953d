"""Attacks on the sockets of the endpoint: only the attacker is ended, and each end is counted."""

import errno
import os
import resource
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
import zmq

from drivers.message import MessageType
from drivers.reason import Reason
from firmware.endpoint.inlet import MAX_FRAME, MAX_FRAMES, Inlet
from firmware.endpoint.peers.guard import Guard
from firmware.endpoint.peers.interest import CountedTopics
from firmware.endpoint.peers.limits import (
    DESCRIPTORS,
    QUEUE,
    TOPIC,
    TOPICS_LOCAL,
    UNFINISHED,
    WAITING,
    most_connections,
    raise_descriptors,
)
from firmware.endpoint.publisher import Publisher
from firmware.endpoint.report import memory_kb
from firmware.routing.drops import Drops
from firmware.routing.router import Routing
from firmware.topics import Topics
from tests.hostile import PATIENCE_S, OldPeer, Peer, frame
from tests.virtual import VirtualLoop

CAM = bytes((2, 2)) + bytes(300)
PART = frame(bytes(60_000), more=True)
INLETS = pytest.mark.parametrize("kind", ["push", "pub"])


class Counting:
    """A router that counts."""

    def __init__(self) -> None:
        self.taken = self.refused = 0

    def request(self, kind: MessageType, pdu: bytes, where: str, asked: object = None) -> None:
        self.taken += 1

    def refuse_message(self, *refused: Any, **more: Any) -> None:
        self.refused += 1


class Bench:
    """The four sockets of an endpoint and their guard, on a loop whose clock moves by what a test turns."""

    def __init__(self, loop: VirtualLoop) -> None:
        self.loop = loop
        self.context = zmq.Context()
        self.drops = Drops()
        self.router = Counting()
        self.wanted: dict[bytes, bool] = {}
        routing = Routing(loop, Topics(), self.drops, self.router)  # type: ignore[arg-type]
        self.inlets = {
            name: Inlet(
                routing,
                self.context,
                kind,
                "tcp://127.0.0.1:0",
                where,
            )
            for name, kind, where in (("push", zmq.PULL, "pull"), ("pub", zmq.SUB, "from_users"))
        }
        counted = CountedTopics((b"v2x.",), self.wanted.__setitem__)
        self.publisher = Publisher(loop, self.context, "tcp://127.0.0.1:0", "to_users", self.drops, counted)
        self.guard = Guard(loop, list(self.inlets.values()), [self.publisher])
        self.peers: list[Peer] = []

    def peer(self, kind: str = "sub", of: type[Peer] = Peer) -> Peer:
        socket_of = self.publisher if kind == "sub" else self.inlets[kind]
        port = int(socket_of._socket.get(zmq.LAST_ENDPOINT).rstrip(b"\0").rpartition(b":")[2])
        self.peers.append(peer := of(port, kind.upper().encode(), self.loop.turn))
        return peer

    def until(self, holds: Callable[[], bool]) -> None:
        """libzmq has a thread of its own: it has time while nothing is ready."""
        self.loop.patience_s = 0.001
        end = time.monotonic() + PATIENCE_S
        while not holds():
            assert time.monotonic() < end, f"not so within {PATIENCE_S} s"
            self.loop.after(0.01, lambda: None)
            self.loop.turn()

    def count(self, where: str, reason: Reason) -> int:
        return self.drops.total(where, reason)

    def open(self) -> int:
        return sum(len(one.door.connections) for one in (*self.inlets.values(), self.publisher))

    def close(self) -> None:
        for peer in self.peers:
            peer.close()
        for one in (*self.inlets.values(), self.publisher):
            one.close()
        self.guard.close()
        self.context.destroy(0)


@pytest.fixture
def bench() -> Iterator[Bench]:
    with closing(VirtualLoop()) as loop, closing(Bench(loop)) as bench:
        yield bench


def push(peer: Peer, count: int) -> None:
    peer.socket.sendall((frame(b"v2x.cam.", more=True) + frame(CAM)) * count)


def flood(bench: Bench, rude: Peer, first: bytes) -> None:
    """Messages of one subscriber until it is ended for that; of one topic: their number does not end it."""
    octets = frame(first + b"same".ljust(200)) * 1000
    rude.socket.settimeout(0.001)

    def is_ended() -> bool:
        with suppress(TimeoutError):
            rude.socket.sendall(octets)
        return bench.count("to_users", Reason.SUBSCRIBER_FLOOD) == 1

    with suppress(OSError):
        bench.until(is_ended)
    bench.until(lambda: bench.count("to_users", Reason.SUBSCRIBER_FLOOD) == 1)


def is_cut_while_sending(peer: Peer) -> bool:
    """As Peer.is_cut(). A look at its last octets may come before libzmq has read them: so there are others."""
    with suppress(OSError):
        peer.socket.sendall(frame(b"", more=True))
    return peer.is_cut()


@INLETS
def test_a_message_that_does_not_end_ends_its_connection_alone(bench: Bench, kind: str) -> None:
    where = {"push": "pull", "pub": "from_users"}[kind]
    good, rude = bench.peer(kind), bench.peer(kind)
    push(good, 10)
    for _ in range(UNFINISHED // 60_000 + 2):
        rude.socket.sendall(PART)
    bench.until(lambda: bench.count(where, Reason.UNFINISHED) == 1)
    bench.until(rude.is_cut)
    push(good, 10)
    bench.until(lambda: bench.router.taken == 20)
    assert not good.is_cut()
    assert bench.router.refused == 0
    bench.until(lambda: bench.open() == 1)


@INLETS
def test_an_honest_sender_of_zmtp_2_loses_neither_its_connection_nor_a_message(bench: Bench, kind: str) -> None:
    good, idle = bench.peer(kind, OldPeer), bench.peer(kind)
    for _ in range(6):
        push(good, 1000)
        bench.loop.run_for(0.05)
    bench.until(lambda: bench.router.taken == 6_000)
    assert not good.is_cut()
    assert not idle.is_cut()


@INLETS
def test_a_message_of_zmtp_2_that_does_not_end_ends_its_connection(
    bench: Bench, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("firmware.endpoint.peers.guard.EXCUSED", 3 * UNFINISHED)
    where = {"push": "pull", "pub": "from_users"}[kind]
    good, rude = bench.peer(kind, OldPeer), bench.peer(kind, OldPeer)
    with suppress(OSError):  # the last parts may come too late
        for _ in range(3 * UNFINISHED // 60_000 + 4):
            rude.socket.sendall(PART)
            bench.router.taken = 0
            push(good, 1)
            bench.until(lambda: bench.router.taken == 1)
            bench.loop.run_for(0.02)
    bench.until(lambda: bench.count(where, Reason.UNFINISHED) == 1)
    bench.until(rude.is_cut)
    assert not good.is_cut()


@INLETS
def test_a_fast_honest_sender_loses_neither_its_connection_nor_a_message(bench: Bench, kind: str) -> None:
    rude, good = bench.peer(kind), bench.peer(kind)
    for _ in range(UNFINISHED // 60_000 + 2):
        rude.socket.sendall(PART)
    for _ in range(6):  # 2 MB: six times what an unfinished message may have
        push(good, 1000)
        bench.loop.run_for(0.05)
    bench.until(lambda: bench.router.taken == 6_000)
    bench.until(lambda: is_cut_while_sending(rude))
    assert not good.is_cut()


def test_the_longest_message_that_is_taken_ends_no_connection(bench: Bench) -> None:
    good = bench.peer("push")
    for _ in range(5):
        for more in (True, True, False):
            good.socket.sendall(frame(bytes(MAX_FRAME), more))
            bench.loop.run_for(5.0)
    bench.until(lambda: bench.router.refused == 5)
    assert not good.is_cut()


def test_a_peer_that_was_idle_for_days_and_answers_heartbeats_stays(bench: Bench) -> None:
    good = bench.peer("push")
    bench.until(lambda: bench.open() == 1)
    for _ in range(200):
        for _ in range(100):  # 2 kB in 100 s
            good.socket.sendall(b"\4\x12\4PING\0\0" + bytes(11))
        bench.until(lambda: bench.open() == 1)
        bench.loop.run_for(100.0)
    assert not good.is_cut()
    assert bench.count("pull", Reason.UNFINISHED) == 0


def test_a_message_of_too_many_frames_ends_its_connection_and_holds_up_nobody(bench: Bench) -> None:
    rude, good = bench.peer("push"), bench.peer("push")
    rude.socket.sendall(frame(b"v2x.cam.", more=True) + frame(CAM, more=True) + frame(b"", more=True) * 20_000)
    rude.send(b"")
    push(good, 10)
    bench.until(lambda: bench.router.taken == 11)
    assert bench.count("pull", Reason.UNFINISHED) == 1
    bench.until(rude.is_cut)
    assert not good.is_cut()


def test_a_message_of_as_many_frames_as_allowed_counts_by_its_first_two(bench: Bench) -> None:
    good = bench.peer("push")
    good.socket.sendall(frame(b"v2x.cam.", True) + frame(CAM, True) + frame(b"", True) * (MAX_FRAMES - 3) + frame(b""))
    push(good, 1)
    bench.until(lambda: bench.router.taken == 2)
    assert not good.is_cut()


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


def test_of_too_many_connections_the_oldest_unused_one_is_ended(bench: Bench) -> None:
    bench.guard.most = 8
    good = bench.peer("push")
    push(good, 1)
    bench.until(lambda: bench.router.taken == 1)
    idle = [bench.peer("push") for _ in range(8)]
    bench.until(idle[0].is_cut)
    late = bench.peer()
    late.subscribe(b"v2x.")
    bench.until(lambda: bench.wanted == {b"v2x.": True})
    bench.until(idle[1].is_cut)
    assert not any(one.is_cut() for one in (good, late, *idle[2:]))
    assert bench.count("pull", Reason.CONNECTIONS) == 2
    bench.until(lambda: bench.open() == 8)


def test_descriptors_of_connections_that_end_are_released(bench: Bench) -> None:
    before = len(os.listdir("/proc/self/fd"))
    peers = [bench.peer(kind) for kind in ("sub", "push", "pub") for _ in range(10)]
    bench.until(lambda: bench.open() == 30)
    for peer in peers:
        peer.close()
    bench.until(lambda: bench.open() == 0)
    bench.until(lambda: len(os.listdir("/proc/self/fd")) <= before)


def test_of_subscribers_that_do_not_read_the_slowest_are_ended_and_counted(bench: Bench) -> None:
    bench.loop.patience_s = 0.0
    slow = []
    for _ in range(6):
        peer = bench.peer()
        peer.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        peer.subscribe(b"")
        slow.append(peer)
    good = bench.peer()
    good.subscribe(b"v2x.")
    bench.until(lambda: bench.publisher._interest.total == 7)
    bench.loop.patience_s = 0.0
    read = b""
    for number in range(40):
        for _ in range(QUEUE // 16):
            bench.publisher.publish(b"v2x.cam.", CAM)
        bench.loop.run_for(0.05)
        read += good.read()
        assert number < 39 or bench.count("to_users", Reason.SUBSCRIBER_CUT)
        if bench.count("to_users", Reason.SUBSCRIBER_CUT):
            break
    cut = bench.count("to_users", Reason.SUBSCRIBER_CUT)
    assert 1 <= cut <= 3
    bench.until(lambda: sum(one.is_ended() for one in slow) == cut)
    assert not good.is_cut()
    waiting = sum(QUEUE for one in bench.publisher.door.connections.values() if one.blocked_at is not None)
    assert waiting <= WAITING + QUEUE


@contextmanager
def descriptors(most: int) -> Iterator[None]:
    """A soft limit of descriptors."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (most, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


def test_memory_is_0_where_descriptors_are_used_up() -> None:
    assert memory_kb() > 0
    with descriptors(1):
        used_up = memory_kb()
    assert used_up == 0


def test_the_limit_of_descriptors_is_raised_and_leaves_room_for_what_is_no_connection() -> None:
    hard = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    with descriptors(1024):
        assert most_connections() == (1024 - 256) // 2
        raise_descriptors()
        assert resource.getrlimit(resource.RLIMIT_NOFILE) == (min(hard, 16_384), hard)
    with descriptors(512):
        assert most_connections() == 128


@pytest.mark.parametrize(
    "unit", ["image/debian/captain.service", "image/overlay/usr/lib/systemd/system/captain.service"]
)
def test_a_unit_gives_the_station_as_many_descriptors_as_it_asks_for(unit: str) -> None:
    assert f"\nLimitNOFILE={DESCRIPTORS}\n" in Path(unit).read_text()


def test_sockets_of_the_endpoint_have_heartbeats(bench: Bench) -> None:
    for one in (*bench.inlets.values(), bench.publisher):
        assert (one._socket.get(zmq.HEARTBEAT_IVL), one._socket.get(zmq.HEARTBEAT_TIMEOUT)) == (10_000, 30_000)


def test_a_connection_for_which_there_is_no_descriptor_is_counted_and_ends_nothing(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(descriptor: int) -> int:
        raise OSError(errno.EMFILE, "Too many open files")

    monkeypatch.setattr("firmware.endpoint.peers.connection.os.dup", refuse)
    peer = bench.peer("push")
    push(peer, 5)
    bench.until(lambda: bench.router.taken == 5)
    bench.loop.run_for(2.0)
    peer.close()
    bench.until(lambda: bench.open() == 0)
