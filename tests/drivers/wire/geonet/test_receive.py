"""Received packets: captured frames, header types, drop reasons, garbage."""

from collections.abc import Mapping

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.message import NOT_SECURED, Area, Position, RxInfo, Security, SecurityStatus, Shape
from drivers.reason import Reason
from drivers.wire.geonet.header import Address, BasicHeader, CommonHeader, HeaderType, LongPosition, ShortPosition
from drivers.wire.geonet.packet import (
    Beacon,
    GeoArea,
    LocationRequest,
    MultiHop,
    Packet,
    SingleHop,
    Unicast,
    encode,
    parse,
)
from drivers.wire.geonet.protocol import Asked, Discard, GeoNetworking, Heard, Mib, Received
from tests.drivers.host import CAM, DENM, request
from tests.drivers.wire.captured import FRAMES, HERE, INGOLSTADT, NEIGHBOUR, NOWHERE, OWN, SIGNED, UNSECURED, packet

PDU = bytes.fromhex("02020000053900010203")
BTP = bytes.fromhex("07d10000")
SPEAKER = bytes.fromhex("02000000000b")
SOURCE = LongPosition(Address(True, 5, 0, SPEAKER), 757810499, 487668616, 114320679, True, 0, 0)
TO_US = ShortPosition(Address(True, 0, 0, OWN), 0, 0, 0)
TO_OTHERS = ShortPosition(Address(True, 0, 0, NEIGHBOUR), 0, 0, 0)
AREA = (INGOLSTADT.latitude, INGOLSTADT.longitude, 500, 200, 45)
FAR_AWAY = (0, 0, 500, 200, 45)

AREAS = {
    HeaderType.GBC_CIRCLE: ("gbc", Shape.CIRCLE),
    HeaderType.GBC_RECTANGLE: ("gbc", Shape.RECTANGLE),
    HeaderType.GBC_ELLIPSE: ("gbc", Shape.ELLIPSE),
    HeaderType.GAC_CIRCLE: ("gac", Shape.CIRCLE),
    HeaderType.GAC_RECTANGLE: ("gac", Shape.RECTANGLE),
    HeaderType.GAC_ELLIPSE: ("gac", Shape.ELLIPSE),
}


def made(header_type, extended, *, payload=BTP + PDU, next_header=2, hop_limit=1, max_hop_limit=1, lifetime=0x1A):
    """Return a valid packet, in which a test may change single fields."""
    common = CommonHeader(next_header, 0, header_type, 2, 0x80, len(payload), max_hop_limit)
    return encode(Packet(BasicHeader(1, 1, 0, lifetime, hop_limit), common, extended, payload))


def shb(**otherwise):
    return made(HeaderType.SHB, SingleHop(SOURCE), **otherwise)


def gbc(header_type=HeaderType.GBC_CIRCLE, area=AREA, sequence=1, source=SOURCE, **otherwise):
    return made(header_type, GeoArea(sequence, 0, source, *area), **otherwise)


def station(**options):
    return GeoNetworking(OWN, Mib(**options))


def received(octets, core=None, now=0.0, ego=HERE, source_mac=NEIGHBOUR):
    return (core or station()).receive(octets, source_mac, now, ego.its_ms, lambda: ego)


# --- captured frames ---


@pytest.mark.parametrize("name", UNSECURED)
def test_an_unsecured_captured_frame_gives_its_pdu_and_what_its_headers_say(name):
    sender = FRAMES[name][6:12]
    event = received(packet(name), station(gn_versions=frozenset({0, 1})), source_mac=sender)
    assert isinstance(event, Received)
    assert event.pdu == parse(packet(name)).payload[4:]
    assert event.rx == RxInfo(
        btp_port=42 if name == "hello-shb" else 2001,
        traffic_class=0,
        hop_limit=1,
        position=Position(487668616, 114320679),
        source_mac=sender,
        transport="shb",
    )


@pytest.mark.parametrize(("name", "ssp"), [("cam-signed-certificate", "010000"), ("cam-signed-digest", "")])
def test_a_signed_frame_gives_its_pdu_as_unverifiable(name, ssp):
    event = received(packet(name))
    assert isinstance(event, Received)
    assert event.pdu[:6] == bytes.fromhex("020200000001")
    assert len(event.pdu) == 41
    assert event.rx.security == Security(SecurityStatus.UNVERIFIABLE_PKT, 36, bytes.fromhex(ssp))
    assert (event.rx.btp_port, event.rx.transport, event.rx.hop_limit) == (2001, "shb", 1)


@pytest.mark.parametrize("name", SIGNED)
def test_a_signed_frame_is_dropped_with_its_reason_where_that_is_wanted(name):
    assert received(packet(name), station(deliver_unverified=False)) == Discard(Reason.SECURED)


def test_a_protocol_version_that_is_not_accepted_is_dropped_with_its_reason():
    assert received(packet("cam-shb-gnversion0")) == Discard(Reason.GN_VERSION)
    assert received(packet("cam-shb"), station(gn_versions=frozenset({0}))) == Discard(Reason.GN_VERSION)


def test_a_protocol_version_is_accepted_by_policy():
    assert isinstance(received(packet("cam-shb-gnversion0"), station(gn_versions=frozenset({0, 1}))), Received)


@pytest.mark.parametrize("name", FRAMES)
def test_a_captured_frame_cut_off_at_any_octet_is_discarded(name):
    core = station(gn_versions=frozenset({0, 1}))
    whole = packet(name)
    for cut in range(len(whole)):
        event = received(whole[:cut], core)
        assert isinstance(event, Discard)
        assert event.reason in (Reason.TRUNCATED, Reason.SECURED_FORMAT), cut
    assert isinstance(received(whole, core), Received)


def secured(inside, header="000124"):
    """Return signed data, with a digest as signer, around the part of a packet after its basic header."""
    signed = b"\x03\x81\x00\x40\x03\x80" + bytes([len(inside) - 4]) + inside[4:] + bytes.fromhex(header)
    return b"\x12" + inside[1:4] + signed + b"\x80" + bytes(8) + b"\x80\x80" + bytes(64)


def test_a_signed_warning_keeps_its_area_and_its_service():
    event = received(secured(gbc(), "000125"))
    assert isinstance(event, Received)
    assert (event.pdu, event.rx.transport) == (PDU, "gbc")
    assert event.rx.area == Area(Shape.CIRCLE, INGOLSTADT, 500, 200, 45)
    assert event.rx.security == Security(SecurityStatus.UNVERIFIABLE_PKT, 37, b"")


def test_the_rules_hold_inside_signed_packets():
    core = station()
    assert received(secured(gbc(area=FAR_AWAY)), core) == Discard(Reason.GN_OUTSIDE_AREA)
    assert received(secured(shb(hop_limit=2)), core) == Discard(Reason.GN_HOP_LIMIT)
    assert received(secured(shb()[:-1]), core) == Discard(Reason.TRUNCATED)
    assert received(secured(b"\x11\0\x1a\1"), core) == Discard(Reason.TRUNCATED)


def test_a_security_envelope_that_cannot_be_read_has_that_reason_whatever_the_policy():
    for allowed in (False, True):
        encrypted = bytes.fromhex("12001a01 0382") + bytes(100)
        found = received(encrypted, station(deliver_unverified=allowed))
        assert found == Discard(Reason.SECURED_FORMAT, "security: encrypted data (0x82)")


# --- header types ---


def test_a_single_hop_broadcast_is_received():
    event = received(shb(), source_mac=SPEAKER)
    assert event == Received(
        PDU,
        RxInfo(
            btp_port=2001,
            traffic_class=2,
            hop_limit=1,
            position=Position(487668616, 114320679),
            source_mac=SPEAKER,
            transport="shb",
        ),
    )
    assert event.rx.security is NOT_SECURED


def test_a_single_hop_broadcast_may_be_repeated():
    core = station()
    assert received(shb(), core) == received(shb(), core)


@pytest.mark.parametrize("header_type", AREAS)
def test_a_packet_for_an_area_around_us_is_received_with_that_area(header_type):
    transport, shape = AREAS[header_type]
    event = received(gbc(header_type, hop_limit=3, max_hop_limit=10))
    assert isinstance(event, Received)
    assert (event.pdu, event.rx.transport, event.rx.hop_limit) == (PDU, transport, 3)
    assert event.rx.area == Area(shape, INGOLSTADT, 500, 200, 45)


@pytest.mark.parametrize("header_type", AREAS)
def test_a_packet_for_an_area_elsewhere_is_dropped(header_type):
    assert received(gbc(header_type, FAR_AWAY)) == Discard(Reason.GN_OUTSIDE_AREA)


@pytest.mark.parametrize("header_type", AREAS)
def test_a_station_that_does_not_know_its_place_takes_every_area_for_its_own(header_type):
    assert isinstance(received(gbc(header_type, FAR_AWAY), ego=NOWHERE), Received)


def test_a_topologically_scoped_broadcast_is_received():
    event = received(made(HeaderType.TSB, MultiHop(1, 0, SOURCE), hop_limit=2, max_hop_limit=5))
    assert isinstance(event, Received)
    assert (event.rx.transport, event.rx.area) == ("tsb", None)


def test_a_unicast_to_us_is_received():
    event = received(made(HeaderType.GUC, Unicast(1, 0, SOURCE, TO_US)))
    assert isinstance(event, Received)
    assert (event.rx.transport, event.rx.area) == ("guc", None)


def test_a_unicast_to_another_station_is_dropped():
    assert received(made(HeaderType.GUC, Unicast(1, 0, SOURCE, TO_OTHERS))) == Discard(Reason.GN_NOT_FOR_US)


def test_a_beacon_shows_a_neighbour():
    octets = made(HeaderType.BEACON, Beacon(SOURCE), payload=b"", next_header=0)
    assert received(octets) == Heard(NEIGHBOUR)


@pytest.mark.parametrize(
    ("header_type", "extended"),
    [
        (HeaderType.ANY, None),
        (HeaderType.LS_REQUEST, LocationRequest(1, 0, SOURCE, TO_OTHERS.address)),
        (HeaderType.LS_REPLY, Unicast(1, 0, SOURCE, TO_US)),
    ],
)
def test_a_packet_without_a_message_for_users_is_dropped(header_type, extended):
    octets = made(header_type, extended, payload=b"" if extended else bytes(60))
    assert received(octets) == Discard(Reason.GN_NOT_FOR_US)


def test_a_request_for_the_own_position_names_the_station_that_asks():
    asked = received(made(HeaderType.LS_REQUEST, LocationRequest(1, 0, SOURCE, TO_US.address), payload=b""))
    assert isinstance(asked, Asked)
    assert asked.mac == NEIGHBOUR
    assert asked.position == ShortPosition(*SOURCE[:4]).write()


def test_a_repeated_request_for_the_own_position_is_a_duplicate():
    core = station()
    octets = made(HeaderType.LS_REQUEST, LocationRequest(1, 0, SOURCE, TO_US.address), payload=b"")
    assert isinstance(received(octets, core), Asked)
    assert received(octets, core) == Discard(Reason.GN_DUPLICATE)


@pytest.mark.parametrize("header_type", [0x11, 0x21, 0x33, 0x43, 0x52, 0x62, 0x70, 0xFF])
def test_a_header_type_that_the_standard_does_not_know_is_dropped(header_type):
    octets = bytearray(shb())
    octets[5] = header_type
    assert received(bytes(octets)) == Discard(Reason.GN_HEADER)


@pytest.mark.parametrize("next_header", [0, 3, 15])
def test_a_basic_header_before_neither_a_common_header_nor_signed_data_is_dropped(next_header):
    octets = bytes([0x10 | next_header]) + shb()[1:]
    assert received(octets) == Discard(Reason.GN_HEADER)


# --- BTP ---


def test_btp_a_is_received_as_well():
    event = received(shb(next_header=1, payload=bytes.fromhex("07d2 1234") + PDU))
    assert isinstance(event, Received)
    assert (event.pdu, event.rx.btp_port) == (PDU, 2002)


@pytest.mark.parametrize("next_header", [0, 3, 4, 15])
def test_what_is_not_btp_is_dropped(next_header):
    assert received(shb(next_header=next_header)) == Discard(Reason.GN_NEXT_HEADER)


@pytest.mark.parametrize("octets", [0, 1, 2, 3])
def test_a_payload_shorter_than_its_btp_header_is_dropped(octets):
    assert received(shb(payload=BTP[:octets])) == Discard(Reason.TRUNCATED)


def test_a_btp_header_alone_brings_an_empty_pdu():
    event = received(shb(payload=BTP))
    assert isinstance(event, Received)
    assert event.pdu == b""


def test_padding_behind_the_payload_is_no_part_of_the_pdu():
    event = received(shb() + bytes(20))
    assert isinstance(event, Received)
    assert event.pdu == PDU


# --- hop limit, lifetime, echo ---


@pytest.mark.parametrize(("hop_limit", "max_hop_limit"), [(0, 0), (0, 1), (0, 255), (2, 1), (255, 254), (1, 0)])
def test_a_hop_limit_that_cannot_be_is_dropped(hop_limit, max_hop_limit):
    octets = gbc(hop_limit=hop_limit, max_hop_limit=max_hop_limit)
    assert received(octets) == Discard(Reason.GN_HOP_LIMIT)


@pytest.mark.parametrize(("hop_limit", "max_hop_limit"), [(1, 1), (1, 255), (255, 255)])
def test_a_hop_limit_from_one_to_its_maximum_is_received(hop_limit, max_hop_limit):
    event = received(gbc(hop_limit=hop_limit, max_hop_limit=max_hop_limit))
    assert isinstance(event, Received)
    assert event.rx.hop_limit == hop_limit


@pytest.mark.parametrize("lifetime", [0, 1, 2, 3])
def test_a_lifetime_of_zero_is_dropped_in_every_base(lifetime):
    assert received(shb(lifetime=lifetime)) == Discard(Reason.GN_LIFETIME)


def test_a_lifetime_of_one_unit_is_received():
    assert isinstance(received(shb(lifetime=4)), Received)


def test_an_own_frame_that_comes_back_is_an_echo():
    core = station()
    assert received(core.encode(request(CAM), 0.0, HERE), core, source_mac=OWN) == Discard(Reason.OWN_ECHO)


def test_an_own_packet_that_another_station_passed_on_is_an_echo():
    core = station()
    wanted = request(DENM, area=Area(Shape.CIRCLE, INGOLSTADT, 500))._replace(hop_limit=10)
    own = core.encode(wanted, 0.0, HERE)
    passed_on = own[:3] + bytes((own[3] - 1,)) + own[4:]
    assert received(passed_on, core) == received(own, core, source_mac=OWN) == Discard(Reason.OWN_ECHO)


def test_a_padded_own_frame_is_an_echo():
    core = station()
    assert received(core.encode(request(CAM), 0.0, HERE) + bytes(9), core, source_mac=OWN) == Discard(Reason.OWN_ECHO)


def test_what_the_core_sends_comes_back_as_its_echo():
    core = station()
    core.expire(0.0)
    assert core.expire(10.0)
    assert received(core.take(HERE), core) == Discard(Reason.OWN_ECHO)


# --- duplicates ---


MULTI_HOP = {
    "gbc": lambda number: gbc(sequence=number),
    "gac": lambda number: gbc(HeaderType.GAC_ELLIPSE, sequence=number),
    "tsb": lambda number: made(HeaderType.TSB, MultiHop(number, 0, SOURCE)),
    "guc": lambda number: made(HeaderType.GUC, Unicast(number, 0, SOURCE, TO_US)),
}


@pytest.mark.parametrize("kind", MULTI_HOP)
def test_the_second_copy_of_a_multi_hop_packet_is_a_duplicate(kind):
    core = station()
    octets = MULTI_HOP[kind](7)
    assert isinstance(received(octets, core), Received)
    assert received(octets, core, source_mac=SPEAKER) == Discard(Reason.GN_DUPLICATE)
    assert isinstance(received(MULTI_HOP[kind](8), core), Received)


def test_the_same_number_of_two_sources_is_no_duplicate():
    core = station()
    other = SOURCE._replace(address=Address(True, 5, 0, bytes.fromhex("02000000000c")))
    assert isinstance(received(gbc(sequence=7), core), Received)
    assert isinstance(received(gbc(sequence=7, source=other), core), Received)


def test_a_duplicate_outside_the_area_is_a_duplicate():
    core = station()
    assert received(gbc(area=FAR_AWAY), core) == Discard(Reason.GN_OUTSIDE_AREA)
    assert received(gbc(area=FAR_AWAY), core) == Discard(Reason.GN_DUPLICATE)


# --- random octets ---


def assert_keeps_the_contract(event):
    if isinstance(event, Received):
        rx = event.rx
        assert isinstance(event.pdu, bytes)
        assert isinstance(rx, RxInfo)
        assert 0 <= rx.btp_port <= 65535
        assert isinstance(rx.security, Security)
        assert len(rx.security.ssp) <= 32
        assert isinstance(rx.position, Position)
        assert rx.area is None or isinstance(rx.area, Area)
        assert rx.transport in {"shb", "gbc", "gac", "tsb", "guc"}
        assert not isinstance(rx, Mapping)
    else:
        assert isinstance(event, Heard | Discard)


@given(octets=st.binary(max_size=120), is_known=st.booleans())
@settings(deadline=None, max_examples=1000)
def test_random_octets_never_raise(octets, is_known):
    core = station(gn_versions=frozenset(range(16)))
    assert_keeps_the_contract(received(octets, core, ego=HERE if is_known else NOWHERE))


@given(kind=st.sampled_from(list(HeaderType)), octets=st.binary(min_size=40, max_size=120))
@settings(deadline=None, max_examples=1000)
def test_random_octets_behind_a_plausible_start_never_raise(kind, octets):
    head = bytes([0x11, 0, 0x1A, 1, 0x20, kind, 2, 0x80, 0, len(octets) - 40, 255, 0])
    assert_keeps_the_contract(received(head + octets))


@given(
    name=st.sampled_from(list(FRAMES)),
    places=st.lists(st.tuples(st.integers(0, 400), st.integers(0, 255)), min_size=1, max_size=4),
)
@settings(deadline=None, max_examples=1000)
def test_a_captured_frame_with_wrong_octets_never_raises(name, places):
    octets = bytearray(packet(name))
    for place, octet in places:
        octets[place % len(octets)] = octet
    assert_keeps_the_contract(received(bytes(octets)))


@pytest.mark.parametrize(("octets", "times"), [(shb(), 0), (gbc(HeaderType.GBC_CIRCLE), 1)])
def test_own_position_is_requested_only_for_a_packet_with_an_area(octets, times):
    asked = []

    def ego():
        asked.append(1)
        return HERE

    station().receive(octets, NEIGHBOUR, 0.0, HERE.its_ms, ego)
    assert len(asked) == times
