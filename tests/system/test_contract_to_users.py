"""Contract, section 1.1: messages for users on port 5556."""

import contextlib

import pytest
import zmq

from tests.system.conftest import Bench, Launcher
from tests.system.station import PATIENCE
from tests.system.user import mark

CAM = bytes.fromhex("020200000539") + b"position and speed"


def test_a_received_pdu_gives_raw_first_and_then_its_type_with_the_octets_unchanged(pdu: Bench) -> None:
    pdu.air.send(CAM)
    first, second = pdu.user.next_frames(), pdu.user.next_frames()
    assert first[0] == b"raw."
    assert second == [b"v2x.cam.", CAM]


def test_the_raw_message_carries_the_same_octets(pdu: Bench) -> None:
    pdu.air.send(CAM)
    fields = pdu.user.receive().fields
    assert fields["pdu"] == CAM
    assert fields["payload_size"] == len(CAM)


def test_messages_of_one_interface_arrive_in_the_order_of_the_air(pdu: Bench) -> None:
    sent = [mark() for _ in range(200)]
    for each in sent:
        pdu.air.send(each)
    assert [pdu.user.receive().pdu for _ in sent] == sent


def test_equal_pdus_of_one_interface_all_arrive(pdu: Bench) -> None:
    for _ in range(50):
        pdu.air.send(CAM)
    assert [pdu.user.receive().pdu for _ in range(50)] == [CAM] * 50


@pytest.mark.parametrize("number", [0, 17, 19, 21, 101, 103, 200, 255])
def test_a_message_id_without_a_name_gives_two_dots(pdu: Bench, number: int) -> None:
    pdu.air.send(sent := bytes((2, number)) + b"\0\0\0\1 something")
    received = pdu.user.receive()
    assert (received.envelope, received.pdu) == (b"v2x..", sent)


def test_every_message_id_of_the_256_gives_one_pair(pdu: Bench) -> None:
    sent = [bytes((2, number)) + b"\0\0\5\x39 pdu" for number in range(256)]
    for each in sent:
        pdu.air.send(each)
    # The order of DENMs among other types is not guaranteed: the station reads them from a separate socket.
    assert sorted(pdu.user.receive().pdu for _ in sent) == sorted(sent)


def test_heartbeats_are_one_blank_no_newline_and_count_by_one(pdu: Bench) -> None:
    first = pdu.user.beat()
    assert pdu.user.beat() == first + 1


def test_a_heartbeat_has_two_frames_and_no_trailing_dot(pdu: Bench) -> None:
    while (frames := pdu.user.sub.recv_multipart())[0] != b"hb.counter":
        pass
    assert frames == [b"hb.counter", b'{"heartbeat_counter": %d}' % int(frames[1][22:-1])]


def test_a_sent_message_is_not_looped_back(pdu: Bench) -> None:
    pdu.user.send(b"v2x.", CAM)
    assert pdu.air.hear().pdu == CAM
    pdu.user.hears_nothing_before_a_mark(pdu.air)


def test_nothing_but_raw_types_and_heartbeats_appears_whatever_happens(launch: Launcher) -> None:
    bench = launch("pdu")
    reports = bench.make_reports()
    for frames in ([b"v2x.cam", CAM], [b"raw.", CAM], [b"status.", b"{}"], [b"one"], [b"v2x.cam.", CAM, b"3"]):
        bench.user.send(*frames)
    bench.user.push_pdu(b"v2x.", CAM, label="x")
    bench.user.push_pdu(b"v2x.", CAM, nonsense=True)
    bench.air.throw(b"\2\2")
    assert reports.next("status.")
    bench.user.hears_nothing_before_a_mark(bench.air)  # next_frames() fails on any other envelope


def test_every_user_receives_everything(pdu: Bench, launch_shared: Launcher) -> None:
    second = launch_shared.user(pdu.station).join(pdu.air)
    pdu.settled()
    second.sub.subscribe(b"v2x.cam.")  # a further subscription causes no second copy
    pdu.air.send(CAM)
    assert pdu.user.receive().pdu == CAM
    while second.receive().pdu != CAM:
        pass


def test_a_user_that_comes_and_goes_disturbs_nobody(pdu: Bench, launch_shared: Launcher) -> None:
    for _ in range(3):
        launch_shared.user(pdu.station).close()
        pdu.air.send(CAM)
        assert pdu.user.receive().pdu == CAM


def test_a_plain_pub_reaches_the_air_once_the_subscription_has_travelled(pdu: Bench) -> None:
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    pub = context.socket(zmq.PUB)
    pub.connect(pdu.station.address("from_users"))
    pdu.air.socket.settimeout(0.02)
    for _ in range(250):
        pub.send_multipart([b"v2x.", CAM])
        with contextlib.suppress(TimeoutError):
            assert pdu.air.hear().pdu == CAM
            break
    pdu.air.socket.settimeout(PATIENCE)
    pub.send_multipart([b"v2x.cam.", last := mark()])
    while pdu.air.hear().pdu != last:
        pass
    context.destroy(linger=0)


def test_whoever_joins_in_the_middle_of_a_stream_misses_the_raw_of_one_message_at_most(launch: Launcher) -> None:
    # A `v2x.` message may come without its `raw.` if the subscription arrived between the two. This also happens with a
    # PUB socket that always sends both.
    bench = launch("pdu")
    # A user who takes PDUs alone hears when each was published: several that come at once are published at once.
    bench.user.sub.subscribe(b"v2x.")
    bench.user.sub.unsubscribe(b"")
    bench.air.send(last := mark())
    bench.user.forget_until(last)

    def pass_one() -> None:
        bench.air.send(CAM)
        assert bench.user.sub.recv_multipart() == [b"v2x.cam.", CAM]

    for _ in range(30):
        joiner = launch.user(bench.station)
        while not joiner.sub.poll(1):
            pass_one()
        pass_one()
        envelopes = (joiner.sub.recv_multipart()[0] for _ in range(4))  # heartbeats may be between them
        received = [envelope for envelope in envelopes if envelope != b"hb.counter"]
        assert b"raw." in received[:2]
        joiner.close()
