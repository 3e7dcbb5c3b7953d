"""A socket that publishes: who is interested in what, and a subscriber that does not keep up."""

import os
import socket
from collections.abc import Iterator
from contextlib import closing
from typing import Any

import pytest
import zmq

from board.runtime.errors import InterfaceError
from drivers.reason import Reason
from firmware.endpoint import publisher as module
from firmware.endpoint.peers.interest import CountedTopics
from firmware.endpoint.publisher import Publisher
from firmware.routing.drops import Drops
from tests.firmware.subscribers import Subscribers, received
from tests.virtual import VirtualLoop

TOPICS = (b"raw.", b"status.")


class Bench:
    def __init__(self, loop: VirtualLoop, address: str = "inproc://publisher", costly: tuple[bytes, ...] = ()) -> None:
        self.loop = loop
        self.context = zmq.Context()
        self.interest: list[tuple[bytes, bool]] = []
        self.drops = Drops()
        counted = CountedTopics(TOPICS, lambda *change: self.interest.append(change), costly=costly)
        self.publisher = Publisher(loop, self.context, address, "to_users", self.drops, counted)
        self.address = self.publisher._socket.get(zmq.LAST_ENDPOINT).rstrip(b"\0").decode()
        total = None if address.startswith("inproc:") else lambda: self.publisher._interest.total
        self.users = Subscribers(loop, self.context, self.address, total)

    def turn(self) -> None:
        self.loop.run_for(0.05)

    def wait_for(self, *changes: tuple[bytes, bool]) -> None:
        """libzmq has a thread of its own that takes closed sockets apart: a second for that."""
        self.loop.patience_s = 1.0
        self.loop.run_until(lambda: self.interest[-len(changes) :] == list(changes))

    def close(self) -> None:
        self.users.close()
        self.publisher.close()
        self.context.term()


@pytest.fixture
def bench() -> Iterator[Bench]:
    with closing(VirtualLoop()) as loop, closing(Bench(loop)) as bench:
        yield bench


def private() -> str:
    """An address whose connections have descriptors, as those of TCP; only with one is the end of interest known."""
    return f"ipc://@captain-test-{os.urandom(8).hex()}"


@pytest.fixture
def remote() -> Iterator[Bench]:
    with closing(VirtualLoop()) as loop, closing(Bench(loop, private())) as bench:
        yield bench


def test_a_message_of_two_frames_reaches_its_subscriber(bench: Bench) -> None:
    subscriber = bench.users.join(b"v2x.")
    bench.publisher.publish(b"v2x.cam.", b"pdu")
    bench.publisher.publish(b"hb.counter", b"{}")
    assert received(subscriber) == [[b"v2x.cam.", b"pdu"]]


@pytest.mark.parametrize(
    ("prefix", "topics"),
    [
        (b"", {b"raw.", b"status."}),
        (b"r", {b"raw."}),
        (b"raw", {b"raw."}),
        (b"raw.", {b"raw."}),
        (b"raw.x", {b"raw."}),
        (b"s", {b"status."}),
        (b"v2x.", set()),
        (b"ra w", set()),
        (b"RAW.", set()),
        (b"\0", set()),
        (b"\1raw.", set()),
    ],
)
def test_a_prefix_is_interest_in_what_it_overlaps(remote: Bench, prefix: bytes, topics: set[bytes]) -> None:
    subscriber = remote.users.join(prefix)
    assert set(remote.interest) == {(topic, True) for topic in topics}
    remote.interest.clear()
    remote.users.unsubscribe(subscriber, prefix)
    assert set(remote.interest) == {(topic, False) for topic in topics}


def test_a_message_of_three_frames_reaches_its_subscriber(bench: Bench) -> None:
    subscriber = bench.users.join(b"v2x.")
    bench.publisher.publish_both(b"v2x.cam.", b"{}", b"pdu")
    assert received(subscriber) == [[b"v2x.cam.", b"{}", b"pdu"]]


def test_a_subscription_to_everything_does_not_ask_for_what_costs_much() -> None:
    with closing(VirtualLoop()) as loop, closing(Bench(loop, private(), costly=(b"raw.",))) as bench:
        everything = bench.users.join(b"")
        assert bench.interest == [(b"status.", True)]
        bench.users.join(b"r")
        assert bench.interest == [(b"status.", True), (b"raw.", True)]
        bench.users.unsubscribe(everything, b"")
        assert bench.interest[2:] == [(b"status.", False)]


def test_interest_lasts_until_the_last_prefix_has_gone(remote: Bench) -> None:
    subscriber = remote.users.join(b"", b"r", b"raw.", b"raw.x")
    assert set(remote.interest) == {(b"raw.", True), (b"status.", True)}
    for prefix in (b"", b"raw.", b"r"):
        remote.users.unsubscribe(subscriber, prefix)
        assert (b"raw.", False) not in remote.interest
    remote.users.unsubscribe(subscriber, b"raw.x")
    assert remote.interest[-1] == (b"raw.", False)


def test_interest_lasts_until_the_last_subscriber_has_gone(remote: Bench) -> None:
    first, second = remote.users.join(b"raw."), remote.users.join(b"raw.")
    assert remote.interest == [(b"raw.", True)] * 2  # each is told: a newcomer may want what was said before
    remote.users.unsubscribe(first, b"raw.")
    assert remote.interest == [(b"raw.", True)] * 2
    second.close(0)
    remote.wait_for((b"raw.", True), (b"raw.", True), (b"raw.", False))


def test_a_subscription_that_comes_while_messages_flow_is_seen(bench: Bench) -> None:
    subscriber = bench.users.socket()
    for number in range(500):
        bench.publisher.publish(b"v2x.cam.", b"%d" % number)
        if number == 250:
            subscriber.subscribe(b"raw.")
    bench.turn()
    assert bench.interest == [(b"raw.", True)]


def test_five_hundred_prefixes_of_one_subscriber_go_with_it(remote: Bench) -> None:
    subscriber = remote.users.join(*(b"raw.%d" % number for number in range(500)))
    assert set(remote.interest) == {(b"raw.", True)}
    subscriber.close(0)
    remote.wait_for((b"raw.", True), (b"raw.", False))


BODY = bytes(1000)  # 8 MB fill the queue and what the kernel holds of a connection
RUBBISH = [b"hello", b"\2raw.", b"\xff", b"x" * 10_000, b"raw.", b"status."]


def test_rubbish_from_a_subscriber_is_ignored(bench: Bench) -> None:
    rude = bench.users.socket(zmq.XSUB)
    for message in RUBBISH:
        rude.send(message)
    rude.send_multipart([b"\2", b"more", b""])
    bench.turn()
    assert bench.interest == []
    subscriber = bench.users.join(b"raw.")
    bench.publisher.publish(b"raw.", b"1")
    assert bench.interest == [(b"raw.", True)]
    assert received(subscriber) == [[b"raw.", b"1"]]


def test_rubbish_of_one_takes_no_subscription_from_another(bench: Bench) -> None:
    rude, first, second = bench.users.socket(zmq.XSUB), bench.users.socket(), bench.users.socket()
    rude.send(b"hello")
    first.subscribe(b"a")
    rude.send(b"hello")
    second.subscribe(b"b")
    bench.turn()
    bench.publisher.publish(b"a", b"1")
    bench.publisher.publish(b"b", b"2")
    assert received(first) == [[b"a", b"1"]]
    assert received(second) == [[b"b", b"2"]]
    assert received(rude) == []


def test_a_flood_of_rubbish_does_not_hold_up_the_rest(bench: Bench) -> None:
    rude = bench.users.socket(zmq.XSUB)
    for _ in range(module.BATCH * 3):
        rude.send(b"hello")
    turns: list[int] = []
    bench.loop.soon(lambda: turns.append(1))
    bench.loop.turn()
    assert turns == [1]
    bench.turn()
    assert bench.users.join(b"raw.")
    assert bench.interest == [(b"raw.", True)]


def test_a_flood_has_one_batch_in_a_turn_however_often_a_look_is_asked_for(
    loop: VirtualLoop, monkeypatch: pytest.MonkeyPatch
) -> None:
    taken = 0

    def take(*asked: Any) -> Any:
        nonlocal taken
        taken += 1
        return recv(*asked)

    def interest(topic: bytes, is_wanted: bool) -> None:
        publisher.wants(b"v2x.cam.")  # as the report port does, which publishes at once

    recv = module._recv
    monkeypatch.setattr(module, "_recv", take)
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    publisher = Publisher(
        loop, context, "inproc://flood", "report", Drops(), CountedTopics(TOPICS, interest, [b"v2x.cam."])
    )
    with closing(publisher), context.socket(zmq.XSUB) as rude:
        rude.linger = 0
        rude.connect("inproc://flood")
        for number in range(module.BATCH * 10):
            rude.send(b"\1raw.%d" % number)
        publisher.ready(0)
        for _ in range(8):
            taken = 0
            publisher.ready(0)
            publisher.look()
            publisher.wants(b"v2x.cam.")
            publisher.publish(b"v2x.cam.", b"")
            loop.now += module.LOOK_S
            loop.turn()
            assert taken == module.BATCH
        rude.send(b"\1v2x.")
        loop.run_for(0.1)
        assert publisher.wants(b"v2x.cam.")
    context.term()


def test_an_unsubscription_of_what_was_never_subscribed_spoils_nothing() -> None:
    # libzmq's own sockets do not send one; ZMTP 3.0 (23/ZMTP) as another implementation may write it.
    greeting = b"\xff" + bytes(8) + b"\x7f" + b"\x03\x00" + b"NULL".ljust(20, b"\0") + bytes(32)
    ready = b"\x05READY" + b"\x0bSocket-Type" + (3).to_bytes(4, "big") + b"SUB"
    with closing(VirtualLoop()) as loop, closing(Bench(loop, "tcp://127.0.0.1:0")) as bench:
        port = int(bench.address.rpartition(":")[2])
        with socket.create_connection(("127.0.0.1", port)) as rude:
            rude.sendall(greeting + b"\x04" + bytes((len(ready),)) + ready)
            answer = b""
            while b"Socket-Type" not in answer:
                answer += rude.recv(200)
            for _ in range(3):
                rude.sendall(b"\x00\x05\x00raw.")
            rude.sendall(b"\x00\x05\x01raw.")
            bench.wait_for((b"raw.", True))
        assert bench.interest[0] == (b"raw.", True)


def test_a_subscriber_that_never_reads_is_noticed_and_the_others_lose_nothing(bench: Bench) -> None:
    bench.users.join(b"")
    reader = bench.users.join(b"")
    count = 0
    while bench.publisher.slow_since is None:
        bench.publisher.publish(b"v2x.cam.", b"%d" % count)
        assert received(reader) == [[b"v2x.cam.", b"%d" % count]]
        count += 1
        assert count < 40_000
    for _ in range(5):
        for _ in range(100):
            bench.publisher.publish(b"v2x.cam.", b"%d" % count)
            assert received(reader) == [[b"v2x.cam.", b"%d" % count]]
            count += 1
        bench.loop.run_for(1.0)
    assert bench.publisher.slow_count >= 1


def test_a_loss_to_a_slow_subscriber_is_counted_where_it_was_with_its_sample(bench: Bench) -> None:
    bench.users.join(b"raw.")
    bench.publisher.publish(b"raw.", b"earlier")
    assert bench.drops.total("to_users", Reason.SUBSCRIBER_SLOW) == 0
    while bench.publisher.slow_since is None:
        bench.publisher.publish(b"raw.", b"sample")
    (drop,) = bench.drops.status()
    assert (drop["where"], drop["reason"], drop["count"]) == ("to_users", "subscriber-slow", 1)
    assert drop["sample"] == b"sample".hex()


def test_what_a_slow_subscriber_did_not_ask_for_is_no_loss(bench: Bench) -> None:
    bench.users.join(b"raw.")
    while bench.publisher.slow_since is None:
        bench.publisher.publish(b"raw.", b"")
    for _ in range(100):
        bench.publisher.publish(b"v2x.cam.", b"")
    assert bench.drops.total("to_users", Reason.SUBSCRIBER_SLOW) == 1


def test_each_time_that_a_subscriber_falls_behind_is_counted(bench: Bench) -> None:
    slow = bench.users.join(b"")
    for count in (1, 2, 3):
        while bench.publisher.slow_count < count:
            bench.publisher.publish(b"v2x.cam.", b"")
        received(slow)
        bench.turn()
    assert bench.drops.total("to_users", Reason.SUBSCRIBER_SLOW) == 3


def test_a_subscriber_that_never_reads_is_slow_until_it_leaves(remote: Bench) -> None:
    slow = remote.users.join(b"raw.")
    while remote.publisher.slow_since is None:
        remote.publisher.publish(b"raw.", BODY)
    remote.loop.patience_s = 0.0
    for _ in range(10):
        remote.publisher.publish(b"raw.", BODY)
        remote.loop.run_for(60.0)
    assert remote.publisher.slow_since is not None
    slow.close(0)
    remote.wait_for((b"raw.", True), (b"raw.", False))
    assert remote.publisher.slow_since is None


def test_a_subscriber_that_reads_again_loses_nothing_more_and_is_noticed_when_it_stops_again(bench: Bench) -> None:
    slow = bench.users.join(b"")
    for count in (1, 2, 3):
        while bench.publisher.slow_count < count:
            bench.publisher.publish(b"v2x.cam.", b"")
        received(slow)
        bench.turn()
        for number in range(100):
            bench.publisher.publish(b"v2x.cam.", b"%d" % number)
        assert [body for _, body in received(slow)] == [b"%d" % number for number in range(100)]


def test_a_message_to_a_slow_subscriber_is_whole_or_not_there(bench: Bench) -> None:
    slow = bench.users.join(b"")
    while bench.publisher.slow_since is None:
        bench.publisher.publish(b"v2x.cam.", b"pdu")
    for _ in range(100):
        bench.publisher.publish(b"v2x.cam.", b"pdu")
    assert all(message == [b"v2x.cam.", b"pdu"] for message in received(slow))


def test_an_address_that_is_taken_names_the_option_and_leaves_nothing_open(bench: Bench) -> None:
    with closing(VirtualLoop()) as loop:
        with pytest.raises(InterfaceError) as caught:
            Publisher(loop, bench.context, bench.address, "report", bench.drops, CountedTopics())
        assert str(caught.value).startswith(f"endpoint.report: cannot bind {bench.address}: ")
        assert loop._sources == {}


@pytest.mark.parametrize("address", ["tcp://127.0.0.1", "nonsense", "tcp://8.8.8.8:5556"])
def test_an_address_that_cannot_be_is_refused_in_words(address: str) -> None:
    refused = pytest.raises(InterfaceError, match=r"endpoint\.report: cannot bind")
    with closing(VirtualLoop()) as loop, zmq.Context() as context, refused:
        Publisher(loop, context, address, "report", Drops(), CountedTopics())


def test_a_timer_that_outlives_the_socket_does_nothing(bench: Bench) -> None:
    other = Publisher(bench.loop, bench.context, "inproc://other", "report", bench.drops, CountedTopics())
    other.publish(b"a", b"b")
    other.close()
    bench.loop.run_for(5.0)
