"""Hostile subscribers: nothing that one sends takes anything from another, or from the station."""

import os
from collections.abc import Iterator
from contextlib import closing

import pytest
import zmq
from zmq.utils.monitor import recv_monitor_message

from drivers.reason import Reason
from firmware.endpoint.peers.connection import Connection
from firmware.endpoint.peers.interest import CountedTopics
from firmware.endpoint.peers.limits import TOPICS_LOCAL
from firmware.endpoint.publisher import Publisher
from firmware.routing.drops import Drops
from tests.hostile import PATIENCE_S, OldPeer, Peer
from tests.virtual import VirtualLoop

TOPICS = (b"raw.", b"frame.", b"status.")


class Bench:
    """A publisher on TCP and on a private address, its peers, and what they want together."""

    def __init__(self, loop: VirtualLoop) -> None:
        self.loop = loop
        self.context = zmq.Context()
        self.drops = Drops()
        self.wanted: dict[bytes, bool] = {}
        self.private = f"ipc://@captain-test-{os.urandom(8).hex()}"
        counted, address = CountedTopics(TOPICS, self._change), "tcp://127.0.0.1:0"
        self.publisher = Publisher(loop, self.context, address, "to_users", self.drops, counted, [self.private])
        self.port = int(self.publisher._socket.get(zmq.LAST_ENDPOINT).rstrip(b"\0").rpartition(b":")[2])
        self.peers: list[Peer] = []
        loop.patience_s = 1.0

    def peer(self, kind: bytes = b"SUB") -> Peer:
        self.peers.append(peer := Peer(self.port, kind, self.loop.turn))
        return peer

    def subscribe(self, peer: Peer, topic: bytes) -> None:
        """Until it is in the set of its connection, and so all that the peer had sent before it was taken."""
        port = peer.socket.getsockname()[1]
        peer.subscribe(topic)
        self.loop.run_until(lambda: any(one.port == port and topic in one.topics for one in self.connections()))

    def connections(self) -> list[Connection]:
        return list(self.publisher.door.connections.values())

    def old_peer(self, topic: bytes) -> OldPeer:
        """A peer of ZMTP 2.0; subscribed when this returns, if nothing was before."""
        self.peers.append(peer := OldPeer(self.port, b"SUB", self.loop.turn))
        peer.subscribe(topic)
        self.loop.run_until(lambda: self.wanted.get(topic) is True)
        return peer

    def leaves(self, peer: Peer) -> None:
        peer.close()
        open_before = len(self.publisher.door.connections)
        self.loop.run_until(lambda: len(self.publisher.door.connections) < open_before)

    def _change(self, topic: bytes, is_wanted: bool) -> None:
        self.wanted[topic] = is_wanted

    def close(self) -> None:
        for peer in self.peers:
            peer.close()
        self.publisher.close()
        self.context.destroy(0)


@pytest.fixture
def bench() -> Iterator[Bench]:
    with closing(VirtualLoop()) as loop, closing(Bench(loop)) as bench:
        yield bench


@pytest.mark.parametrize("topic", [b"raw.", b"frame.", b"", b"r", b"raw.x"])
def test_an_unsubscription_without_a_subscription_takes_nothing_from_another_peer(bench: Bench, topic: bytes) -> None:
    good, rude = bench.peer(), bench.peer()
    bench.subscribe(good, topic or b"raw.")
    for _ in range(3):
        rude.unsubscribe(topic)
    bench.subscribe(rude, b"status.")
    assert bench.wanted.get(b"frame." if topic == b"frame." else b"raw.") is True
    bench.leaves(rude)
    assert bench.wanted[b"status."] is False
    assert bench.wanted[b"frame." if topic == b"frame." else b"raw."] is True


def test_a_subscription_twice_and_its_end_once_leave_no_interest(bench: Bench) -> None:
    peer = bench.peer()
    bench.subscribe(peer, b"raw.")
    peer.subscribe(b"raw.")
    peer.unsubscribe(b"raw.")
    bench.subscribe(peer, b"status.")
    assert bench.wanted == {b"raw.": False, b"status.": True}


def test_the_end_of_a_connection_ends_what_it_alone_wanted(bench: Bench) -> None:
    first, second = bench.peer(), bench.peer()
    for topic in (b"raw.", b"frame."):
        bench.subscribe(first, topic)
    bench.subscribe(second, b"raw.")
    bench.leaves(first)
    assert bench.wanted == {b"raw.": True, b"frame.": False}
    bench.leaves(second)
    assert bench.wanted == {b"raw.": False, b"frame.": False}


def test_interest_of_a_private_subscriber_outlasts_all_that_peers_send(bench: Bench) -> None:
    with bench.context.socket(zmq.SUB) as recorder:
        recorder.linger = 0
        recorder.connect(bench.private)
        recorder.subscribe(b"frame.")
        bench.loop.run_until(lambda: bench.wanted.get(b"frame.") is True)
        rude = bench.peer()
        for _ in range(3):
            rude.unsubscribe(b"frame.")
        bench.subscribe(rude, b"frame.")
        bench.leaves(rude)
        assert bench.wanted[b"frame."] is True
        bench.publisher.publish(b"frame.air.", b"{}")
        assert recorder.poll(1000)
        assert recorder.recv_multipart() == [b"frame.air.", b"{}"]


def test_a_subscriber_of_a_unix_socket_has_as_many_topics_as_one_of_this_machine(bench: Bench) -> None:
    with bench.context.socket(zmq.SUB) as recorder, bench.context.socket(zmq.SUB) as rude:
        for one in (recorder, rude):
            one.linger = 0
            one.reconnect_ivl = -1
            one.connect(bench.private)
        recorder.subscribe(b"frame.")
        bench.loop.run_until(lambda: bench.wanted.get(b"frame.") is True)
        for number in range(TOPICS_LOCAL):
            rude.subscribe(b"raw.%d" % number)
        bench.loop.run_until(lambda: len(bench.connections()) == 1)
        assert bench.drops.total("to_users", Reason.TOPICS) == 1
        assert bench.wanted[b"frame."] is True
        bench.publisher.publish(b"frame.air.", b"{}")
        assert recorder.poll(PATIENCE_S * 1000)


def test_a_private_address_is_for_programs_of_the_same_user(loop: VirtualLoop, monkeypatch: pytest.MonkeyPatch) -> None:
    other = os.geteuid() + 1
    monkeypatch.setattr("firmware.endpoint.publisher.os.geteuid", lambda: other)
    with closing(Bench(loop)) as bench, bench.context.socket(zmq.SUB) as stranger:
        stranger.linger = 0
        stranger.subscribe(b"frame.")
        ends = stranger.get_monitor_socket(zmq.EVENT_DISCONNECTED | zmq.EVENT_HANDSHAKE_SUCCEEDED)
        stranger.connect(bench.private)
        event = recv_monitor_message(ends)
        stranger.disable_monitor()
        assert event["event"] == zmq.EVENT_DISCONNECTED
        bench.subscribe(bench.peer(), b"raw.")
        assert bench.wanted == {b"raw.": True}


def test_a_subscriber_whose_descriptor_is_used_again_keeps_its_own_topics(bench: Bench) -> None:
    for _ in range(20):
        first = bench.peer()
        bench.subscribe(first, b"raw.")
        first.close()
        second = bench.peer()
        bench.subscribe(second, b"raw.")
        bench.loop.run_until(lambda: len(bench.publisher.door.connections) == 1)
        assert bench.wanted[b"raw."] is True
        bench.leaves(second)
        assert bench.wanted[b"raw."] is False


@pytest.mark.parametrize("leave", ["by closing", "by unsubscribing"])
def test_a_zmtp_2_subscriber_receives_after_another_subscriber_has_left(bench: Bench, leave: str) -> None:
    old = bench.old_peer(b"raw.")
    new = bench.peer()
    bench.subscribe(new, b"raw.")
    if leave == "by unsubscribing":
        new.unsubscribe(b"raw.")
    bench.leaves(new)
    bench.subscribe(bench.peer(), b"status.")  # libzmq's own unsubscription of a connection's end comes before it
    assert bench.wanted[b"raw."] is True
    bench.publisher.publish(b"raw.", b"octets")
    bench.loop.run_until(lambda: b"octets" in old.read())


def test_interest_of_a_zmtp_2_subscriber_is_never_taken_back(bench: Bench) -> None:
    old, other = bench.old_peer(b"raw."), bench.old_peer(b"raw.")
    old.unsubscribe(b"raw.")
    bench.leaves(old)
    bench.subscribe(bench.peer(), b"status.")
    assert bench.wanted[b"raw."] is True
    bench.publisher.publish(b"raw.", b"octets")
    bench.loop.run_until(lambda: b"octets" in other.read())
