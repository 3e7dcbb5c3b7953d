"""Frames for a recorder: each with its outcome, missed ones counted."""

import json
import math
from collections.abc import Iterator
from contextlib import closing
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from board.time.scales import Lock, TimeQuality
from drivers.contract import NOW, Witness
from drivers.message import (
    NO_RX_INFO,
    Area,
    Confirm,
    Ego,
    Indication,
    Outcome,
    Position,
    Request,
    RxInfo,
    Shape,
)
from drivers.packet.geolink import GeoLink
from drivers.reason import MEANING, Reason
from firmware.endpoint import frames
from firmware.endpoint.frames import FLOOD, LATER_S, MOST, OF_FLOOD, Frames
from firmware.endpoint.report import digest_of
from firmware.recordings.layers import Carried, NoMessage, open_frame
from firmware.routing.drops import Drops
from firmware.topics import Topics
from tests.drivers.host import SHARED, Host
from tests.firmware.doubles import CAM_PDU, INGOLSTADT, pdu_of, request_of
from tests.reference.topics import undocumented
from tests.virtual import VirtualLoop

MAC, PEER = bytes.fromhex("02000000000b"), bytes.fromhex("02000000000c")
NOW_NS = 1_795_182_426_461_613_000
EGO = Ego(722_130_000_000, INGOLSTADT, True)
QUALITY = TimeQuality(Lock.LOCKED, 10, 50)
TOPICS = Topics()
# EN 302 636-4-1 clause 9.8.6, of a station at Ingolstadt.
BEACON = bytes.fromhex(
    "ffffffffffff02000000000c894711001a010010008000000100000002000000000c0000000a1d1139d806d06ee880000000"
)


class Counts:
    """Of an interface."""

    def __init__(self) -> None:
        self.received = [0]
        self.sent_count = [0]


class Bench:
    """A station that shows all it has to the frames, for as long as they attend."""

    def __init__(self, loop: VirtualLoop) -> None:
        self.loop = loop
        self.interfaces = {"air": Counts(), "wire": Counts()}
        self.requests = self.accepted = 0
        self.burst: list[bytes] = []  # what has come and has not gone up yet
        self.told: list[tuple[bytes, dict[str, Any], bytes]] = []
        self.drops = Drops()
        self.witness = Witness()
        self.frames = Frames(loop, self.publish, self, MAC, self.drops, self.attend)
        self.drops.listener = self.frames
        self.attend(True)

    def attend(self, is_wanted: bool) -> None:
        self.is_shown = is_wanted
        self.witness.watch = self.frames if is_wanted else None

    def flush(self) -> None:
        burst, self.burst = self.burst, []
        for pdu in burst:
            self.indicate(pdu)

    def confirm(self, confirm: Confirm) -> None:
        if confirm.outcome is Outcome.REFUSED:
            self.requests += 1
        elif confirm.outcome is Outcome.SENT:
            self.interfaces[confirm.interface].sent_count[0] += 1
        if self.is_shown:
            self.frames.confirm(confirm)

    def ego(self) -> Ego:
        return EGO

    def quality_now(self) -> TimeQuality:
        return QUALITY

    def publish(self, topic: bytes, body: bytes, octets: bytes) -> None:
        said = json.loads(body)
        assert undocumented("frame", said) == []
        self.told.append((topic, said, octets))

    def indicate(self, pdu: bytes, interface: str = "air", rx: RxInfo = NO_RX_INFO, when_ns: int = NOW_NS) -> None:
        kind = TOPICS.by_number[pdu[1]]
        self.interfaces[interface].received[0] += 1
        if not self.is_shown:
            return
        self.frames.observe([Indication(kind, pdu, interface, when_ns, 0.0, rx, QUALITY)])

    def later(self) -> list[dict[str, Any]]:
        """What was told of since the last time."""
        self.loop.run_for(LATER_S * 1.5)
        told, self.told = self.told, []
        self.octets = [octets for _, _, octets in told]
        return [said for _, said, _ in told]


@pytest.fixture(autouse=True, scope="module")
def unix_time() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(frames, "time", SimpleNamespace(time_ns=lambda: NOW_NS))
        yield


@pytest.fixture
def bench() -> Iterator[Bench]:
    with closing(VirtualLoop()) as loop:
        yield Bench(loop)


def gn_frame(pdu: bytes = CAM_PDU, request: Request | None = None) -> bytes:
    with closing(VirtualLoop()) as loop:
        return GeoLink(Host(loop), SHARED, PEER, 0.0, lambda _: None).encode(request or request_of(pdu=pdu))


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


def linked(bench: Bench) -> tuple[GeoLink, Host]:
    """A link whose station is the bench: its host indicates and drops there."""
    host = Host(bench.loop)
    host.name = "air"
    host.indicate = lambda pdu, received_ns, rx=NO_RX_INFO: bench.indicate(pdu, rx=rx, when_ns=received_ns)
    host.drop = lambda reason, sample=b"", count=1, detail="": bench.drops.count("air", reason, sample, count, detail)
    return GeoLink(host, SHARED._replace(witness=bench.witness), MAC, 3.0, lambda octets: NOW), host


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


def test_drops_of_other_places_are_not_frames(bench: Bench) -> None:
    bench.drops.count("report", Reason.SUBSCRIBER_SLOW, b"{}")
    bench.drops.count("pull", Reason.BAD_ENVELOPE, b"x")
    assert bench.later() == []


def test_what_the_kernel_dropped_is_missed(bench: Bench) -> None:
    bench.drops.count("air", Reason.KERNEL_QUEUE, count=40)
    bench.indicate(CAM_PDU)
    assert [said["missed"] for said in bench.later()] == [40]
    bench.indicate(CAM_PDU)
    assert [said["missed"] for said in bench.later()] == [0]


def test_of_a_flood_the_rest_is_counted(bench: Bench) -> None:
    link, _ = linked(bench)
    for number in range(MOST + 30):
        link.receive(gn_frame(pdu_of(2, number)), NOW_NS)
    assert len(bench.later()) == MOST
    bench.indicate(pdu_of(2), "wire")
    link.receive(gn_frame(pdu_of(2, 7000)), NOW_NS)
    assert [(said["interface"], said["missed"], said["sequence"]) for said in bench.later()] == [
        ("wire", 0, 1),
        ("air", 30, MOST + 1),
    ]


def test_of_a_flood_of_refusals_each_is_counted_once(bench: Bench) -> None:
    for number in range(MOST + 30):
        request = request_of(number, pdu=pdu_of(2, number))
        bench.drops.count("wire", Reason.QUEUE_FULL, request.pdu)
        bench.confirm(Confirm(request, Outcome.DROPPED, "wire", Reason.QUEUE_FULL))
    assert len(bench.later()) == MOST
    bench.indicate(pdu_of(2), "wire")
    assert [said["missed"] for said in bench.later()] == [30]


EVENTS = ("in", "out", "dropped", "refused", "duplicate", "kernel", "wait")


@settings(deadline=None, max_examples=60)
@given(st.lists(st.tuples(st.sampled_from(EVENTS), st.integers(1, 2 * MOST)), max_size=12))
def test_what_is_told_and_what_is_missed_come_to_all_that_was(events: list[tuple[str, int]]) -> None:
    with closing(VirtualLoop()) as loop:
        bench = Bench(loop)
        happened = 0
        numbers = iter(range(10**6))
        for what, count in events:
            for _ in range(count if what != "wait" else 0):
                pdu = pdu_of(2, next(numbers))
                request = request_of(next(numbers), pdu=pdu)
                match what:
                    case "in":
                        bench.indicate(pdu, "wire")
                    case "duplicate":
                        bench.indicate(pdu, "wire")
                        bench.drops.count("wire", Reason.DUPLICATE, pdu)
                    case "kernel":
                        bench.drops.count("wire", Reason.KERNEL_QUEUE)
                    case "out":
                        bench.confirm(Confirm(request, Outcome.SENT, "wire"))
                    case "dropped":
                        bench.drops.count("wire", Reason.QUEUE_FULL, pdu)
                        bench.confirm(Confirm(request, Outcome.DROPPED, "wire", Reason.QUEUE_FULL))
                    case "refused":
                        bench.confirm(Confirm(request, Outcome.REFUSED, "", Reason.POLICY))
                happened += 1
            if what == "wait":
                loop.run_for(LATER_S * count / MOST)
        loop.run_for(1.0)
        bench.indicate(pdu_of(2), "wire")
        bench.confirm(Confirm(request_of(), Outcome.REFUSED, "", Reason.POLICY))
        loop.run_for(1.0)
        assert len(bench.told) + sum(said["missed"] for _, said, _ in bench.told) == happened + 2
        assert all(said["missed"] >= 0 for _, said, _ in bench.told)


def test_what_fills_the_room_is_told_as_dropped_if_it_was(bench: Bench) -> None:
    pdus = [pdu_of(2, number) for number in range(MOST)]
    for pdu in pdus:
        bench.indicate(pdu, "wire")
    for pdu in pdus:
        bench.drops.count("wire", Reason.DUPLICATE, pdu)
    assert not bench.is_shown
    assert {said.get("reason") for said in bench.later()} == {"duplicate"}


def test_in_a_flood_it_looks_away_and_looks_again(bench: Bench) -> None:
    for _ in range(10):
        for number in range(10 * MOST):
            bench.indicate(pdu_of(2, number), "wire")
        assert not bench.is_shown
        bench.loop.run_for(LATER_S * 1.5)
        assert bench.is_shown
    assert len(bench.told) == 10 * MOST


def test_the_more_comes_the_less_of_it_is_told(bench: Bench) -> None:
    counts = (FLOOD + MOST, FLOOD + MOST + 1, FLOOD + OF_FLOOD + 1, FLOOD, MOST, 1)
    told = []
    for count in counts:
        for number in range(count):
            bench.indicate(pdu_of(2, number), "wire")
        told.append(bench.later())
    assert [len(some) for some in told] == [MOST, MOST, OF_FLOOD, OF_FLOOD, MOST, 1]
    assert sum(1 + one["missed"] for some in told for one in some) == sum(counts)


def test_drops_that_no_confirm_follows_are_missed_for_good(bench: Bench) -> None:
    for number in range(MOST + 1):
        bench.indicate(pdu_of(2, number), "wire")
    lost = pdu_of(2, 7000)
    bench.drops.count("wire", Reason.BTP_PORT, lost)
    bench.drops.count("wire", Reason.KERNEL_QUEUE, count=5)
    bench.later()
    empty = request_of(pdu=b"")
    bench.confirm(Confirm(empty, Outcome.DROPPED, "wire", Reason.EXPIRED))
    bench.confirm(Confirm(request_of(pdu=lost), Outcome.SENT, "wire"))
    assert [said["missed"] for said in bench.later()] == [7, 0]


def test_what_waits_is_told_before_the_station_ends(bench: Bench) -> None:
    for number in range(MOST - 1):
        bench.indicate(pdu_of(2, number), "wire")
    bench.drops.count("air", Reason.BTP_PORT, pdu_of(2, 7000))
    bench.frames.finish()
    assert [said.get("reason") for _, said, _ in bench.told] == [None] * (MOST - 1) + ["btp-port"]
    assert len(bench.later()) == MOST


def test_a_listener_who_left_leaves_nothing_behind(bench: Bench) -> None:
    bench.indicate(CAM_PDU)
    bench.frames.forget()
    assert bench.later() == []
    bench.indicate(CAM_PDU)
    assert len(bench.later()) == 1


def test_frames_of_requests_that_nobody_confirms_are_bounded(bench: Bench) -> None:
    link, _ = linked(bench)
    for number in range(5000):
        link.encode(request_of(number, deadline=math.inf))
    assert len(bench.frames._made) < 5000
