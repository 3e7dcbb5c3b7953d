"""Implausible frames: places, times, senders and numbers that cannot be are marked, counted, and dropped by policy."""

import json
from collections.abc import Iterator
from contextlib import closing
from typing import Any

import pytest

from drivers.contract import NOW
from drivers.message import NO_RX_INFO, Area, Ego, Indication, Position, RxInfo, Shape
from drivers.packet.geolink import GeoLink
from drivers.reason import Reason
from drivers.wire.geonet.header import Address, BasicHeader, CommonHeader, HeaderType, LongPosition, ShortPosition
from drivers.wire.geonet.own import KEPT, OwnPackets
from drivers.wire.geonet.packet import Beacon, Extended, GeoArea, LocationRequest, Packet, SingleHop, Unicast, encode
from drivers.wire.raw import build
from firmware.config.tables import Match, PolicyRow
from firmware.endpoint.report import Report
from firmware.routing.drops import Drops
from firmware.routing.policy import Policy
from firmware.routing.router import Router
from firmware.topics import Topics
from tests.drivers.host import CAM, EGO, SHARED, request
from tests.firmware.doubles import ScriptedDriver, interface_of
from tests.firmware.endpoint.test_report import NotingPublisher
from tests.virtual import VirtualLoop

OWN, SENDER, OTHER, OURS_TOO = (bytes.fromhex(f"0200000000{octet}") for octet in ("0d", "0a", "0b", "0e"))
STAMP = EGO.its_ms % 2**32
SOURCE = LongPosition(Address(False, 5, 0, SENDER), STAMP, *EGO.position, True, 0, 0)
AREA = (*EGO.position, 500, 0, 0)
BTP = bytes.fromhex("07d10000")
TOPICS = Topics()
DAY_MS = 86_400_000
YEAR_MS = 365 * DAY_MS


def framed(
    header_type: int,
    extended: Extended,
    pdu: bytes = CAM,
    hops: tuple[int, int] = (1, 1),
    sender: bytes = SENDER,
    btp: bytes = BTP,
) -> bytes:
    """An Ethernet frame; hops: remaining and maximum hop limit."""
    payload = btp + pdu if pdu else b""
    common = CommonHeader(2 if pdu else 0, 0, header_type, 2, 0x80, len(payload), hops[1])
    packet = encode(Packet(BasicHeader(1, 1, 0, 0x1A, hops[0]), common, extended, payload))
    return b"\xff" * 6 + sender + b"\x89\x47" + packet


def cam(source: LongPosition = SOURCE, sender: bytes = SENDER, pdu: bytes = CAM) -> bytes:
    return framed(HeaderType.SHB, SingleHop(source), pdu, sender=sender)


def warning(
    sequence: int = 1,
    pdu: bytes = CAM,
    source: LongPosition = SOURCE,
    sender: bytes = SENDER,
    hops: tuple[int, int] = (10, 10),
    area: tuple[int, int, int, int, int] = AREA,
) -> bytes:
    return framed(HeaderType.GBC_CIRCLE, GeoArea(sequence, 0, source, *area), pdu, hops, sender)


def denm(detection_ms: int, reference_ms: int) -> bytes:
    """The start of a DENM of any edition, as its UPER has it, and some octets more."""
    bits = 7 << 16 | 1  # actionID, behind four presence bits, an extension bit and five more
    bits = (bits << 42 | detection_ms) << 42 | reference_ms
    return bytes.fromhex("020100000007") + (bits << 3).to_bytes(18) + bytes(20)


class Station:
    """Reception of one station as far as the users and the report port; what it sends is noted."""

    def __init__(self, loop: VirtualLoop, ego: Ego = EGO) -> None:
        self.drops = Drops()
        self.router = Router(loop, TOPICS, self.drops, lambda: ego, lambda: ego.its_ms)
        self.interface = interface_of(loop, self.router, ScriptedDriver(), drops=self.drops, topics=TOPICS)
        self.router.add(self.interface)
        self.link = self.another_link()
        self.delivered: list[Indication] = []
        self.router.users = self
        self.publisher = NotingPublisher()
        self.report = Report(loop, self.publisher, dict, lambda: None, dict)

    def publish(self, indications: list[Indication]) -> None:
        """As the users' side does."""
        self.delivered += indications

    def another_link(self, own: OwnPackets | None = None, mac: bytes = OWN) -> GeoLink:
        return GeoLink(self.interface, SHARED._replace(own=own), mac, 0.0, lambda octets: NOW)

    def receive(self, *frames: bytes) -> None:
        for octets in frames:
            self.link.receive(octets, 0)
        self.router.flush()

    def indicate(self, pdu: bytes, rx: RxInfo = NO_RX_INFO) -> None:
        """As an interface without GeoNetworking does."""
        self.interface.indicate(pdu, 0, rx)
        self.router.flush()

    def policy(self, *rows: PolicyRow) -> None:
        self.router.set_policy(Policy(rows, TOPICS, self.router))

    @property
    def doubts(self) -> list[list[str]]:
        """Of each delivered message."""
        return [list(map(str, one.rx.implausible)) for one in self.delivered]

    @property
    def counts(self) -> dict[str, int]:
        status: Any = self.interface.status()
        return {row["reason"]: row["count"] for row in status.get("implausible", [])}

    def dropped(self) -> dict[str, int]:
        rows: list[Any] = list(self.drops.status())
        return {row["reason"]: row["count"] for row in rows}


@pytest.fixture
def loop() -> Iterator[VirtualLoop]:
    with closing(VirtualLoop()) as loop:
        yield loop


@pytest.fixture
def station(loop: VirtualLoop) -> Station:
    return Station(loop)


def test_plausible_frames_have_no_mark_and_no_count(station: Station) -> None:
    station.receive(cam(), warning(), warning(2, sender=OTHER, hops=(9, 10)))
    assert station.doubts == [[], [], []]
    assert "implausible" not in station.interface.status()
    assert station.dropped() == {}


# --- position ---


@pytest.mark.parametrize(
    ("latitude", "longitude", "is_marked"),
    [
        (2_147_483_647, 114_320_680, True),  # 214.7 degrees
        (-2_147_483_648, 114_320_680, True),
        (900_000_002, 0, True),
        (487_668_616, 1_800_000_002, True),
        (487_668_616, -1_800_000_001, True),
        (900_000_001, 1_800_000_001, False),  # not known
        (900_000_000, 1_800_000_000, False),
        (-900_000_000, -1_800_000_000, False),
    ],
)
def test_a_place_outside_the_world_is_marked(station: Station, latitude: int, longitude: int, is_marked: bool) -> None:
    station.receive(cam(SOURCE._replace(latitude=latitude, longitude=longitude)))
    station.indicate(CAM, RxInfo(btp_port=2001, position=Position(latitude, longitude)))  # a radio, a process
    assert station.doubts == [["position"] * is_marked] * 2
    assert station.counts == ({"position": 2} if is_marked else {})


def test_an_area_outside_the_world_is_marked(loop: VirtualLoop) -> None:
    station = Station(loop, EGO._replace(is_known=False))
    station.receive(warning(area=(2_147_483_647, 0, 500, 0, 0)))
    assert station.doubts == [["position"]]


# --- time ---


@pytest.mark.parametrize(
    ("ahead_ms", "is_marked"),
    [
        (0, False),
        (59_000, False),  # leap seconds that are not known: 5, 18, 37 s
        (61_000, True),
        (20 * DAY_MS, True),
        (-6_300_000, False),  # the longest lifetime of a packet
        (-6_362_000, True),
        (-20 * DAY_MS, True),
        (2 * YEAR_MS, True),
        (2**32, False),  # 49.7 days: the number is the same
    ],
)
def test_a_timestamp_that_is_far_off_is_marked(station: Station, ahead_ms: int, is_marked: bool) -> None:
    station.receive(cam(SOURCE._replace(timestamp=(STAMP + ahead_ms) % 2**32)))
    assert station.doubts == [["time"] * is_marked]
    assert station.counts == ({"time": 1} if is_marked else {})


def test_a_station_that_does_not_know_the_time_marks_none(loop: VirtualLoop) -> None:
    station = Station(loop, Ego(0, Position(), False))
    station.receive(cam(SOURCE._replace(timestamp=12345)))
    station.indicate(denm(2**42 - 1, 2**42 - 1))
    assert station.doubts == [[], []]


@pytest.mark.parametrize(
    ("detection_ms", "reference_ms", "is_marked"),
    [
        (0, 0, False),
        (-5 * YEAR_MS, -5 * YEAR_MS, False),  # road works
        (59_000, 59_000, False),
        (3 * YEAR_MS, 0, True),
        (0, 3 * YEAR_MS, True),
        (49 * DAY_MS, 49 * DAY_MS, True),
    ],
)
@pytest.mark.parametrize("rx", [NO_RX_INFO, RxInfo(btp_port=2002)])
def test_a_denm_of_the_future_is_marked_by_every_interface(
    station: Station, detection_ms: int, reference_ms: int, is_marked: bool, rx: RxInfo
) -> None:
    station.indicate(denm(EGO.its_ms + detection_ms, EGO.its_ms + reference_ms), rx)
    assert station.doubts == [["time"] * is_marked]


@pytest.mark.parametrize("pdu", [denm(2**42 - 1, 0)[:23], b"\x05" + denm(2**42 - 1, 0)[1:]])
def test_a_denm_whose_times_cannot_be_read_is_not_marked(station: Station, pdu: bytes) -> None:
    station.indicate(pdu)
    assert station.doubts == [[]]


# --- source ---


@pytest.mark.parametrize(
    "octets",
    [cam(sender=OTHER), warning(sender=OTHER), warning(sender=OTHER, hops=(1, 1))],
    ids=["single hop", "first of ten hops", "first of one hop"],
)
def test_a_first_hop_by_another_than_its_source_is_marked(station: Station, octets: bytes) -> None:
    station.receive(octets)
    assert station.doubts == [["source"]]


def test_a_single_hop_has_the_same_sender_whatever_its_hop_limits(station: Station) -> None:
    station.receive(framed(HeaderType.SHB, SingleHop(SOURCE), hops=(1, 10), sender=OTHER))
    assert station.doubts == [["source"]]


def test_a_packet_that_was_passed_on_has_another_sender_and_no_mark(station: Station) -> None:
    station.receive(warning(sender=OTHER, hops=(9, 10)))
    assert station.doubts == [[]]


# --- sequence ---


def test_numbers_ahead_in_the_name_of_a_victim_do_not_silence_it(station: Station) -> None:
    # 8 forged frames with the next numbers of the victim, then its own 8.
    numbers = range(65532, 65540)
    forged = [warning(number & 0xFFFF, CAM[:-1] + b"\xff") for number in numbers]
    own = [warning(number & 0xFFFF) for number in numbers]
    station.receive(*forged, *own)
    assert [one.pdu for one in station.delivered[8:]] == [CAM] * 8
    assert station.doubts == [[]] * 8 + [["sequence"]] * 8
    assert station.counts == {"sequence": 8}
    station.receive(*own)  # passed on
    assert station.dropped() == {"gn-duplicate": 8}


# --- own address ---


OURS = SOURCE._replace(address=Address(False, 5, 0, OWN))


@pytest.mark.parametrize(
    ("octets", "doubts"),
    [
        (cam(OURS, OWN), ["own-address"]),
        (cam(sender=OWN), ["source", "own-address"]),
        (cam(OURS), ["source", "own-address"]),
        (warning(source=OURS, hops=(9, 10)), ["own-address"]),
    ],
    ids=["both", "of the frame", "of the packet", "passed on"],
)
def test_a_message_of_another_station_with_the_own_address_is_marked(
    station: Station, octets: bytes, doubts: list[str]
) -> None:
    station.receive(octets)
    assert station.doubts == [doubts]
    assert station.dropped() == {}


@pytest.mark.parametrize(
    "octets",
    [
        framed(HeaderType.BEACON, Beacon(OURS), b"", sender=OWN),
        framed(HeaderType.LS_REQUEST, LocationRequest(1, 0, OURS, OURS.address), b"", (10, 10), OWN),
    ],
    ids=["beacon", "request"],
)
def test_what_has_no_message_and_the_own_address_is_dropped_with_its_reason(station: Station, octets: bytes) -> None:
    station.receive(octets)
    assert station.dropped() == {"own-address": 1}
    assert station.interface.neighbours.count(0.0) == 0


def test_own_frames_that_come_back_are_echoes_and_no_other_station(station: Station) -> None:
    wanted = request(CAM, area=Area(Shape.CIRCLE, EGO.position, 500))._replace(hop_limit=10)
    single, multi = station.link.encode(request(CAM)), station.link.encode(wanted)
    passed_on = multi[:6] + OTHER + multi[12:17] + b"\x09" + multi[18:]
    station.receive(single, single + bytes(7), multi, passed_on)
    assert station.delivered == []
    assert station.dropped() == {"own-echo": 4}


def test_what_one_interface_has_sent_is_an_echo_at_another(station: Station) -> None:
    own = OwnPackets()
    one, station.link = station.another_link(own), station.another_link(own)
    station.receive(one.encode(request(CAM)))
    assert station.dropped() == {"own-echo": 1}


def test_what_an_interface_with_another_address_has_sent_is_an_echo(station: Station) -> None:
    own = OwnPackets()
    station.link, another = station.another_link(own), station.another_link(own, OURS_TOO)
    single = another.encode(request(CAM))
    multi = another.encode(request(CAM, area=Area(Shape.CIRCLE, EGO.position, 500))._replace(hop_limit=10))
    passed_on = multi[:6] + OTHER + multi[12:17] + b"\x09" + multi[18:]
    station.receive(single, multi, passed_on)
    assert station.dropped() == {"own-echo": 3}


def test_a_frame_with_the_address_of_another_interface_that_it_has_not_sent_is_marked(station: Station) -> None:
    own = OwnPackets()
    station.link, another = station.another_link(own), station.another_link(own, OURS_TOO)
    single = another.encode(request(CAM))
    station.receive(single[:-1] + bytes([single[-1] ^ 1]))
    assert station.doubts == [["own-address"]]


def test_own_packets_are_remembered_in_bounded_memory() -> None:
    own = OwnPackets()
    packets = [number.to_bytes(8) for number in range(5 * KEPT)]
    for packet in packets:
        own.note(packet)
    assert all(own.has(packet[4:]) for packet in packets[-KEPT:])
    assert not any(own.has(packet[4:]) for packet in packets[: 3 * KEPT])


def test_an_answer_to_a_request_and_a_beacon_that_come_back_are_echoes(loop: VirtualLoop) -> None:
    station = Station(loop)
    sent: list[bytes] = []
    station.link = GeoLink(station.interface, SHARED, OWN, 1.0, lambda octets: (sent.append(octets), NOW)[1])
    asked = LocationRequest(1, 0, SOURCE, Address(False, 0, 0, OWN))
    station.receive(framed(HeaderType.LS_REQUEST, asked, b"", (10, 10)))
    station.link.start()
    loop.run_for(3.0)
    station.link.stop()
    kinds = {octets[19] for octets in sent}
    assert kinds == {HeaderType.BEACON, HeaderType.LS_REPLY}
    station.receive(*sent)
    assert station.dropped() == {"own-echo": len(sent)}


def test_a_reply_with_the_own_address_that_was_never_sent_is_for_another_station(station: Station) -> None:
    to = ShortPosition(Address(False, 0, 0, OTHER), 0, 0, 0)
    station.receive(framed(HeaderType.LS_REPLY, Unicast(3, 0, OURS, to), b"", (10, 10), OWN))
    assert station.dropped() == {"gn-not-for-us": 1}


# --- the mark ---


def test_all_reasons_of_a_frame_are_in_one_mark_and_each_is_counted(station: Station) -> None:
    source = OURS._replace(latitude=2_147_483_647, timestamp=(STAMP + DAY_MS) % 2**32)
    station.receive(warning(source=source, pdu=CAM + b"\xff"), warning(source=source))
    assert station.doubts[1] == ["position", "time", "source", "sequence", "own-address"]
    assert station.counts == {"position": 2, "time": 2, "source": 2, "own-address": 2, "sequence": 1}
    status: Any = station.interface.status()
    row = next(row for row in status["implausible"] if row["reason"] == "position")
    assert (row["sample"], row["octets"], row["source"]) == (CAM.hex(), len(CAM), "02:00:00:00:00:0a")
    assert "latitude" in row["meaning"]


def test_raw_has_the_octets_that_it_has_without_a_mark(station: Station) -> None:
    station.receive(cam(SOURCE._replace(latitude=2_147_483_647), OTHER))
    (one,) = station.delivered
    assert one.rx.implausible
    assert build(one.pdu, 0, one.rx) == build(one.pdu, 0, one.rx._replace(implausible=()))


def test_only_indications_of_implausible_messages_have_the_member(loop: VirtualLoop, station: Station) -> None:
    station.router.set_listeners([station.report], [])
    station.receive(cam(), cam(sender=OTHER))
    loop.run_for(1.0)
    first, second = (said for _, said in station.publisher.said)
    assert "implausible" not in first
    assert second["implausible"] == ["source"]
    assert second.keys() - first.keys() == {"implausible"}


def test_the_topic_for_implausible_messages_has_these_alone_and_before_the_message(
    station: Station, monkeypatch: pytest.MonkeyPatch
) -> None:
    station.router.set_listeners([station.report.implausible], [])
    order: list[str] = []

    def report(topic: bytes, body: bytes) -> None:
        order.append(f"{topic.decode()} {json.loads(body)['implausible']}")

    def deliver(burst: list[Indication]) -> None:
        order.extend(one.kind.name for one in burst)

    monkeypatch.setattr(station.publisher, "publish", report)
    monkeypatch.setattr(station, "publish", deliver)
    station.receive(cam(), cam(sender=OTHER))
    assert order == ["implausible.cam. ['source']", "cam", "cam"]


# --- the policy ---


def row(*reasons: str, interfaces: tuple[str, ...] = (), **match: Any) -> PolicyRow:
    return PolicyRow(name="nonsense", match=Match(implausible=reasons, **match), interfaces=interfaces)  # type: ignore[arg-type]


def test_without_a_row_implausible_messages_are_delivered(station: Station) -> None:
    station.receive(cam(sender=OTHER))
    assert len(station.delivered) == 1


@pytest.mark.parametrize(
    ("rows", "is_dropped"),
    [
        ((row("any"),), True),
        ((row("source"),), True),
        ((row("time", "source"),), True),
        ((row("position"),), False),
        ((row("any", type=("cam",)),), True),
        ((row("any", type=("denm",)),), False),
        ((row("any", station=(1337,)),), True),
        ((row("any", station=(7,)),), False),
        ((row("any", btp_port=(2001,)),), True),
        ((row("any", interfaces=("*",), station=(1337,)), row("any")), False),  # a test station
    ],
)
def test_a_row_drops_what_its_match_names(station: Station, rows: tuple[PolicyRow, ...], is_dropped: bool) -> None:
    station.policy(*rows)
    station.receive(cam(), cam(sender=OTHER))
    assert len(station.delivered) == 2 - is_dropped
    assert station.dropped() == ({"implausible": 1} if is_dropped else {})
    assert station.counts == {"source": 1}  # whatever becomes of it


def test_the_drop_names_the_reasons_and_the_row_counts_it(station: Station) -> None:
    station.policy(row("any"))
    station.receive(cam(OURS))
    (drop,) = station.drops.status()
    assert (drop["where"], drop["detail"], drop["sample"]) == ("g5", "source, own-address", CAM.hex())
    assert station.router.policy.status()[0] == {"name": "nonsense", "matched": 1}


def test_a_row_for_received_messages_holds_back_none_that_leave(station: Station) -> None:
    station.policy(row("any"))
    station.router.request(TOPICS.by_number[2], CAM, "from_users")
    assert station.router.accepted == 1
    assert Reason.POLICY not in station.dropped()
