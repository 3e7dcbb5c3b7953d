"""Frames for a recorder: each with its outcome."""

import pytest

from drivers.message import (
    Area,
    Confirm,
    Outcome,
    Position,
    RxInfo,
    Shape,
)
from drivers.reason import MEANING, Reason
from firmware.endpoint.frames import LATER_S
from firmware.endpoint.report import digest_of
from firmware.recordings.layers import Carried, NoMessage, open_frame
from tests.firmware.doubles import CAM_PDU, INGOLSTADT, pdu_of, request_of
from tests.firmware.endpoint.frames_bench import BEACON, MAC, NOW_NS, PEER, Bench, bench, gn_frame, linked, unix_time

__all__ = ["bench", "unix_time"]  # fixtures


def test_a_frame_whose_message_has_not_gone_up_yet_is_told_with_it(bench: Bench) -> None:
    frame = gn_frame()
    pdu = frame[-len(CAM_PDU) :]
    bench.frames.came("air", frame, NOW_NS, pdu)
    bench.burst.append(pdu)
    (said,) = bench.later()
    assert (said["type"], said["digest"], bench.octets) == ("cam", digest_of(CAM_PDU), [frame])


def test_a_message_without_a_frame_is_told_in_one_that_is_made_up(bench: Bench) -> None:
    bench.indicate(CAM_PDU, rx=RxInfo(btp_port=2001, rssi_dbm=-71, source_mac=PEER, position=Position(7, 8)))
    (said,) = bench.later()
    assert said == {
        "sequence": 1,
        "missed": 0,
        "total": 1,
        "interface": "air",
        "direction": "in",
        "when_ns": NOW_NS,
        "quality": {"state": "locked", "error_ns": 60, "offset_ns": 10, "uncertainty_ns": 50},
        "is_made_up": True,
        "type": "cam",
        "message_id": 2,
        "station_id": 1337,
        "digest": digest_of(CAM_PDU),
        "rssi_dbm": -71,
    }
    assert open_frame(1, bench.octets[0]) == Carried(CAM_PDU, 2001, "shb", False)
    assert bench.octets[0][6:12] == PEER


def test_nothing_is_said_at_once(bench: Bench) -> None:
    bench.indicate(CAM_PDU)
    assert bench.told == []


def test_the_topic_names_the_interface(bench: Bench) -> None:
    bench.indicate(CAM_PDU, "wire")
    bench.loop.run_for(LATER_S * 2)
    assert bench.told[0][0] == b"frame.wire."


def test_an_area_makes_it_a_geobroadcast(bench: Bench) -> None:
    area = Area(Shape.ELLIPSE, INGOLSTADT, 300, 100, 45)
    bench.indicate(pdu_of(1), rx=RxInfo(btp_port=2002, area=area, hop_limit=7))
    bench.later()
    assert open_frame(1, bench.octets[0]) == Carried(pdu_of(1), 2002, "gbc_ellipse", False)


def test_a_sender_without_an_address_has_one_of_its_station_id(bench: Bench) -> None:
    bench.indicate(CAM_PDU, rx=RxInfo(source="client-7"))
    bench.later()
    assert bench.octets[0][6:12] == b"\x02\x00" + CAM_PDU[2:6]


@pytest.mark.parametrize("number", [200, 2])
def test_a_type_without_a_port_is_a_frame_as_well(bench: Bench, number: int) -> None:
    bench.indicate(pdu_of(number))
    bench.later()
    carried = open_frame(1, bench.octets[0])
    assert isinstance(carried, Carried)
    assert (carried.pdu, carried.btp_port) == (pdu_of(number), 2001 if number == 2 else 0)


def test_a_frame_is_told_as_it_came(bench: Bench) -> None:
    link, _ = linked(bench)
    link.receive(frame := gn_frame(), NOW_NS - 5)
    (said,) = bench.later()
    assert (said["is_made_up"], said["when_ns"], said["type"]) == (False, NOW_NS - 5, "cam")
    assert bench.octets == [frame]


def test_a_frame_that_is_dropped_says_why(bench: Bench) -> None:
    link, _ = linked(bench)
    gbc = gn_frame(request=request_of()._replace(area=Area(Shape.CIRCLE, Position(0, 0), 10), hop_limit=3))
    link.receive(gbc, NOW_NS)
    (said,) = bench.later()
    assert (said["reason"], said["meaning"]) == ("gn-outside-area", MEANING[Reason.GN_OUTSIDE_AREA])
    assert "type" not in said
    assert bench.octets == [gbc]


def test_a_duplicate_is_its_own_frame_with_its_reason(bench: Bench) -> None:
    link, _ = linked(bench)
    link.receive(gn_frame(), NOW_NS)
    pdu = bytes(bytearray(CAM_PDU))
    bench.indicate(pdu, "wire")
    bench.drops.count("wire", Reason.DUPLICATE, pdu)
    first, second = bench.later()
    assert "reason" not in first
    assert (second["interface"], second["reason"]) == ("wire", "duplicate")


def test_the_same_pdu_at_two_interfaces_is_dropped_at_one(bench: Bench) -> None:
    bench.indicate(CAM_PDU, "air")
    bench.indicate(CAM_PDU, "wire")
    bench.drops.count("wire", Reason.DUPLICATE, CAM_PDU)
    assert ["reason" in said for said in bench.later()] == [False, True]


@pytest.mark.parametrize(
    ("octets", "is_made_up"),
    [(b"short", True), (bytes(12) + b"\x08\x00" + b"another protocol", True), (gn_frame()[:-20], False)],
)
def test_what_is_no_frame_of_ours_is_told_as_well(bench: Bench, octets: bytes, is_made_up: bool) -> None:
    link, _ = linked(bench)
    link.receive(gn_frame(), NOW_NS)
    link.receive(octets, NOW_NS)
    _, said = bench.later()
    assert said["is_made_up"] is is_made_up
    assert said["reason"] in ("truncated", "not-geonetworking")
    assert octets in bench.octets[1]


def test_our_own_frame_that_comes_back_is_told_with_its_reason(bench: Bench) -> None:
    link, _ = linked(bench)
    own = link.encode(request_of())
    link.receive(gn_frame(), NOW_NS)
    link.receive(own, NOW_NS)
    assert [said.get("reason") for said in bench.later()] == [None, "own-echo"]
    assert bench.octets[1] == own


def test_an_implausible_frame_is_told_with_its_reasons(bench: Bench) -> None:
    link, _ = linked(bench)
    link.receive(gn_frame(), NOW_NS)
    assert "implausible" not in bench.later()[-1]
    link.receive(gn_frame()[:6] + bytes.fromhex("02000000000f") + gn_frame()[12:], NOW_NS)
    assert bench.later()[-1]["implausible"] == "source"


def test_a_beacon_that_leaves_is_told(bench: Bench) -> None:
    link, _ = linked(bench)
    link.start()
    bench.loop.run_for(10.0)
    assert len(bench.told) >= 2
    assert {said["direction"] for _, said, _ in bench.told} == {"out"}
    assert open_frame(1, bench.told[0][2]) == NoMessage("beacons")


def test_a_beacon_that_is_heard_is_told(bench: Bench) -> None:
    link, host = linked(bench)
    link.receive(BEACON, NOW_NS)
    (said,) = bench.later()
    assert (said["direction"], bench.octets, host.neighbours) == ("in", [BEACON], [PEER])
    assert "reason" not in said


def test_what_leaves_is_told_when_it_has_left(bench: Bench) -> None:
    link, _ = linked(bench)
    request = request_of(7)
    frame = link.encode(request)
    assert bench.later() == []
    bench.confirm(Confirm(request, Outcome.ACCEPTED))
    bench.confirm(Confirm(request, Outcome.SENT, "air", None, 0.001, 0.0002))
    (said,) = bench.later()
    assert (said["direction"], said["request"], said["queue_us"], said["send_us"]) == ("out", 7, 1000.0, 200.0)
    assert (said["when_ns"], said["is_made_up"], bench.octets) == (NOW_NS, False, [frame])


def test_what_was_made_twice_because_there_was_no_room_is_told_once(bench: Bench) -> None:
    link, _ = linked(bench)
    request = request_of(7)
    link.encode(request)
    second = link.encode(request)
    bench.confirm(Confirm(request, Outcome.SENT, "air"))
    assert len(bench.later()) == 1
    assert bench.octets == [second]


def test_what_leaves_by_an_interface_without_frames_is_made_up(bench: Bench) -> None:
    bench.confirm(Confirm(request_of(), Outcome.SENT, "wire"))
    (said,) = bench.later()
    assert said["is_made_up"]
    assert open_frame(1, bench.octets[0]) == Carried(CAM_PDU, 2001, "shb", False)
    assert bench.octets[0][6:12] == MAC


def test_what_a_queue_drops_is_told_once(bench: Bench) -> None:
    request = request_of()
    bench.drops.count("wire", Reason.EXPIRED, request.pdu)
    bench.confirm(Confirm(request, Outcome.DROPPED, "wire", Reason.EXPIRED, detail="late"))
    (said,) = bench.later()
    assert (said["direction"], said["reason"], said["detail"]) == ("out", "expired", "late")


def test_what_the_station_refuses_went_to_no_interface(bench: Bench) -> None:
    request = request_of()
    bench.drops.count("pull", Reason.POLICY, request.pdu)
    bench.confirm(Confirm(request, Outcome.REFUSED, "", Reason.POLICY))
    (said,) = bench.later()
    assert (said["interface"], said["reason"]) == ("users", "policy")


def test_what_no_header_has_room_for_is_told_all_the_same(bench: Bench) -> None:
    nowhere = Area(Shape.CIRCLE, Position(1 << 40, 0), 10)
    bench.confirm(Confirm(request_of()._replace(area=nowhere), Outcome.SENT, "wire"))
    assert len(bench.later()) == 1
    assert CAM_PDU in bench.octets[0]
