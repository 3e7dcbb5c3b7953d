"""Output to users: raw., v2x.<type>., heartbeat, and nothing else."""

from collections.abc import Iterator
from contextlib import closing

import pytest
import zmq

from drivers.message import NO_RX_INFO, Ego, Indication, Position, RxInfo
from drivers.wire import raw
from firmware.endpoint.users import Users, heartbeat
from firmware.routing.drops import Drops
from firmware.topics import Topics
from tests.firmware.doubles import CAM_PDU, INGOLSTADT, pdu_of
from tests.firmware.subscribers import Subscribers, received
from tests.virtual import VirtualLoop

TOPICS = Topics()


class Bench:
    def __init__(self, loop: VirtualLoop) -> None:
        self.loop = loop
        self.context = zmq.Context()
        self.position: Position | None = INGOLSTADT
        self.users = Users(loop, self.context, "inproc://users", TOPICS, Drops(), self.ego)
        self.subscribers = Subscribers(loop, self.context, "inproc://users")

    def ego(self) -> Ego:
        return Ego(0, self.position or Position(), self.position is not None)

    def publish(self, pdu: bytes = CAM_PDU, rx: RxInfo = NO_RX_INFO) -> None:
        kind = TOPICS.by_number[pdu[1]]
        self.users.publish([Indication(kind, pdu, "g5", 1_795_182_426_461_613_000, self.loop.clock(), rx)])

    def close(self) -> None:
        self.subscribers.close()
        self.users.publisher.close()
        self.context.term()


@pytest.fixture
def bench() -> Iterator[Bench]:
    with closing(VirtualLoop()) as loop, closing(Bench(loop)) as bench:
        yield bench


def test_raw_comes_first_and_then_the_pdu_as_it_was(bench: Bench) -> None:
    subscriber = bench.subscribers.join(b"")
    rx = RxInfo(rssi_dbm=-71, source_mac=b"\1\2\3\4\5\6")
    bench.publish(rx=rx)
    (first, octets), second = received(subscriber)
    assert (first, second) == (b"raw.", [b"v2x.cam.", CAM_PDU])
    parsed = raw.parse(octets)
    assert (parsed.pdu, parsed.rx.rssi_dbm, parsed.rx.source_mac) == (CAM_PDU, -71, b"\1\2\3\4\5\6")
    assert parsed.local is not None
    assert parsed.local[1] == INGOLSTADT


def test_without_an_own_position_localinfo_is_left_out(bench: Bench) -> None:
    bench.position = None
    subscriber = bench.subscribers.join(b"raw.")
    bench.publish()
    assert raw.parse(received(subscriber)[0][1]).local is None


def test_raw_is_not_built_for_nobody(bench: Bench) -> None:
    subscriber = bench.subscribers.join(b"v2x.")
    bench.publish()
    assert received(subscriber) == [[b"v2x.cam.", CAM_PDU]]
    assert (bench.users.raw, bench.users.published) == (0, 1)


def test_whoever_comes_between_two_messages_receives_both_of_the_next() -> None:
    for before in range(20):
        with closing(VirtualLoop()) as loop, closing(Bench(loop)) as bench:
            for _ in range(before):
                bench.publish()
            late = bench.subscribers.socket()
            late.subscribe(b"")
            loop.now += 0.0005
            bench.publish()
            assert [envelope for envelope, _ in received(late)] == [b"raw.", b"v2x.cam."]


def test_an_unknown_type_has_two_dots(bench: Bench) -> None:
    subscriber = bench.subscribers.join(b"v2x.")
    bench.publish(pdu_of(222))
    assert received(subscriber) == [[b"v2x..", pdu_of(222)]]


def test_a_heartbeat_comes_at_the_start_and_once_a_second(bench: Bench) -> None:
    subscriber = bench.subscribers.join(b"")
    bench.users.start()
    assert received(subscriber) == [[b"hb.counter", b'{"heartbeat_counter": 0}']]
    bench.loop.run_for(3.5)
    assert [body for _, body in received(subscriber)] == [heartbeat(count) for count in (1, 2, 3)]


@pytest.mark.parametrize(
    ("count", "number"), [(0, 0), (1, 1), (65534, 65534), (65535, 65535), (65536, 0), (65537, 1), (131072, 0)]
)
def test_the_heartbeat_is_a_16_bit_count_that_wraps(count: int, number: int) -> None:
    assert heartbeat(count) == b'{"heartbeat_counter": %d}' % number


def test_the_heartbeat_wraps_on_the_socket(bench: Bench) -> None:
    subscriber = bench.subscribers.join(b"")
    bench.users._beats = 65535
    bench.users.start()
    bench.loop.run_for(1.5)
    assert [body for _, body in received(subscriber)] == [heartbeat(65535), heartbeat(0)]
