"""GeoNetworking headers: all fields compared with tshark and captured frames; round trips."""

import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from board.runtime.errors import ProtocolError
from drivers.wire.geonet.header import (
    Address,
    BasicHeader,
    CommonHeader,
    HeaderType,
    LongPosition,
    ShortPosition,
    lifetime_octet,
    seconds,
)
from drivers.wire.geonet.packet import (
    EXTENDED,
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
from drivers.wire.security import unwrap
from tests.drivers.wire.captured import FRAMES, SIGNED, UNSECURED, ethernet, packet, tshark


def unsigned(bits):
    return st.integers(0, 2**bits - 1)


def signed(bits):
    return st.integers(-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)


BASIC = st.builds(BasicHeader, unsigned(4), st.sampled_from([0, 1]), unsigned(8), unsigned(8), unsigned(8))
ADDRESS = st.builds(Address, st.booleans(), unsigned(5), unsigned(10), st.binary(min_size=6, max_size=6))
SOURCE = st.builds(
    LongPosition,
    ADDRESS,
    unsigned(32),
    signed(32),
    signed(32),
    st.booleans(),
    signed(15),
    unsigned(16),
)
DESTINATION = st.builds(ShortPosition, ADDRESS, unsigned(32), signed(32), signed(32))
NUMBERS = (unsigned(16), unsigned(16))
HEADERS = {
    Beacon: st.builds(Beacon, SOURCE),
    SingleHop: st.builds(SingleHop, SOURCE, unsigned(32)),
    MultiHop: st.builds(MultiHop, *NUMBERS, SOURCE),
    Unicast: st.builds(Unicast, *NUMBERS, SOURCE, DESTINATION),
    LocationRequest: st.builds(LocationRequest, *NUMBERS, SOURCE, ADDRESS),
    GeoArea: st.builds(GeoArea, *NUMBERS, SOURCE, signed(32), signed(32), *[unsigned(16)] * 4),
}


@st.composite
def packets(draw):
    header_type = draw(st.sampled_from(list(HeaderType)))
    extended = draw(HEADERS[EXTENDED[header_type][0]]) if header_type else None
    payload = draw(st.binary(max_size=60))
    common = CommonHeader(
        draw(unsigned(4)),
        draw(unsigned(4)),
        header_type,
        draw(unsigned(8)),
        draw(unsigned(8)),
        len(payload),
        draw(unsigned(8)),
        draw(unsigned(8)),
    )
    return Packet(draw(BASIC), common, extended, payload)


# --- as tshark shows it ---


def expected_of_basic(basic):
    return {
        "geonw.bh.version": basic.version,
        "geonw.bh.nh": basic.next_header,
        "geonw.bh.reserved": basic.reserved,
        "geonw.bh.lt": basic.lifetime,
        "geonw.bh.lt.mult": basic.lifetime >> 2,
        "geonw.bh.lt.base": basic.lifetime & 3,
        "geonw.bh.rhl": basic.hop_limit,
    }


def expected_of_common(common):
    return {
        "geonw.ch.nh": common.next_header,
        "geonw.ch.reserved1": common.reserved,
        "geonw.ch.htype": common.header_type,
        "geonw.ch.tclass": common.traffic_class,
        "geonw.ch.tc.buffer": common.traffic_class >> 7,
        "geonw.ch.tc.offload": common.traffic_class >> 6 & 1,
        "geonw.ch.tc.id": common.traffic_class & 63,
        "geonw.ch.flags.mob": common.flags >> 7,
        "geonw.ch.flags.reserved": common.flags & 127,
        "geonw.ch.plength": common.payload_length,
        "geonw.ch.mhl": common.max_hop_limit,
        "geonw.ch.reserved2": common.reserved_2,
    }


def expected_of_address(address, name):
    return {
        f"{name}.addr.manual": address.is_manual,
        f"{name}.addr.type": address.station_type,
        f"{name}.addr.country": address.reserved,
        f"{name}.addr.mid": address.mac,
    }


def expected_of_extended(extended):
    source = extended.source
    fields = expected_of_address(source.address, "geonw.src_pos") | {
        "geonw.src_pos.tst": source.timestamp,
        "geonw.src_pos.lat": source.latitude,
        "geonw.src_pos.long": source.longitude,
        "geonw.src_pos.pai": source.is_accurate,
        "geonw.src_pos.speed": source.speed,
        "geonw.src_pos.hdg": source.heading,
    }
    if isinstance(extended, SingleHop):
        return fields | {"geonw.shb.reserved": extended.media & 0xFF}
    if isinstance(extended, Beacon):
        return fields
    fields |= {"geonw.seq_num": extended.sequence, "geonw.reserved": extended.reserved}
    if isinstance(extended, Unicast):
        there = extended.destination
        return (
            fields
            | expected_of_address(there.address, "geonw.dst_pos")
            | {
                "geonw.dst_pos.tst": there.timestamp,
                "geonw.dst_pos.lat": there.latitude,
                "geonw.dst_pos.long": there.longitude,
            }
        )
    if isinstance(extended, LocationRequest):
        return fields | expected_of_address(extended.address, "geonw.ls_req")
    if isinstance(extended, GeoArea):
        return fields | {
            "geonw.gxc.latitude": extended.latitude,
            "geonw.gxc.longitude": extended.longitude,
            "geonw.gxc.distanceb": extended.distance_b,
            "geonw.gxc.angle": extended.angle,
            "geonw.gxc.reserved": extended.reserved_2,
        }
    return fields


def expected_of_distance(taken_apart):
    if not isinstance(taken_apart.extended, GeoArea):
        return {}
    is_circle = taken_apart.common.header_type in (HeaderType.GAC_CIRCLE, HeaderType.GBC_CIRCLE)
    return {f"geonw.gxc.{'radius' if is_circle else 'distancea'}": taken_apart.extended.distance_a}


def expected_of_btp(taken_apart):
    if len(taken_apart.payload) < 4:
        return {}
    first, second = struct.unpack_from(">HH", taken_apart.payload)
    if taken_apart.common.next_header == 1:
        return {"btpa.dstport": first, "btpa.srcport": second}
    return {"btpb.dstport": first, "btpb.dstportinf": second}


def expected(taken_apart):
    """Return all fields that tshark can name, as the project's own parser reads them."""
    return (
        expected_of_basic(taken_apart.basic)
        | expected_of_common(taken_apart.common)
        | expected_of_extended(taken_apart.extended)
        | expected_of_distance(taken_apart)
        | expected_of_btp(taken_apart)
    )


def value(name, text):
    return bytes.fromhex(text.replace(":", "")) if name.endswith(".mid") else int(text, 0)


def assert_shown(shown, wanted):
    assert {name: value(name, shown[name]) for name in wanted if name in shown} == wanted


@pytest.mark.parametrize("name", UNSECURED)
def test_every_header_field_of_a_captured_frame_is_as_tshark_shows_it(name, tmp_path):
    (shown,) = tshark([FRAMES[name]], tmp_path)
    assert_shown(shown, expected(parse(packet(name))))


@pytest.mark.parametrize("name", SIGNED)
def test_every_header_field_of_a_signed_frame_is_as_tshark_shows_it(name, tmp_path):
    (shown,) = tshark([FRAMES[name]], tmp_path)
    octets = packet(name)
    inside = parse(octets[:4].replace(b"\x12", b"\x11", 1) + unwrap(octets[4:]).payload)
    secured = inside._replace(basic=BasicHeader.read(octets, 0))
    assert secured.basic.next_header == 2
    assert_shown(shown, expected(secured))


def test_every_header_type_is_as_tshark_shows_it(tmp_path):
    here = LongPosition(Address(True, 5, 49, b"\2\0\0\0\0\x0b"), 757810499, 487668616, -114320679, True, -1234, 900)
    there = ShortPosition(Address(False, 15, 276, b"\2\0\0\0\0\x0c"), 757810400, -487668616, 114320679)
    area = (487660000, 114320000, 500, 0, 0, 0)
    bodies = {
        HeaderType.BEACON: Beacon(here),
        HeaderType.GUC: Unicast(7, 0, here, there),
        HeaderType.SHB: SingleHop(here, 7),
        HeaderType.TSB: MultiHop(8, 0, here),
        HeaderType.LS_REQUEST: LocationRequest(9, 0, here, there.address),
        HeaderType.LS_REPLY: Unicast(10, 0, here, there),
        HeaderType.GAC_CIRCLE: GeoArea(65535, 0, here, *area),
        HeaderType.GAC_RECTANGLE: GeoArea(12, 0, here, *area[:3], 200, 45, 0),
        HeaderType.GAC_ELLIPSE: GeoArea(13, 0, here, *area[:3], 200, 359, 0),
        HeaderType.GBC_CIRCLE: GeoArea(14, 0, here, *area),
        HeaderType.GBC_RECTANGLE: GeoArea(15, 0, here, *area[:3], 65535, 45, 0),
        HeaderType.GBC_ELLIPSE: GeoArea(16, 0, here, *area[:3], 200, 45, 0),
    }
    silent = (HeaderType.BEACON, HeaderType.LS_REQUEST, HeaderType.LS_REPLY)
    made = []
    for number, (header_type, extended) in enumerate(bodies.items()):
        payload = b"" if header_type in silent else bytes.fromhex("002a0000c0ffee")
        next_header = 0 if header_type in silent else 1 + number % 2
        common = CommonHeader(next_header, 0, header_type, 0x80 + number, 0x80, len(payload), 5)
        made.append(Packet(BasicHeader(1, 1, 0, 0x1A, 3), common, extended, payload))
    shown = tshark([ethernet(encode(one)) for one in made], tmp_path)
    assert len(shown) == len(EXTENDED)
    for one, fields in zip(made, shown, strict=True):
        assert_shown(fields, expected(one))
        assert "geonw.reserved_not_zero" not in fields
        assert not [name for name in fields if name.startswith("_ws.malformed")]


# --- there and back ---


@pytest.mark.parametrize("name", UNSECURED)
def test_a_captured_frame_is_encoded_to_the_same_octets(name):
    assert encode(parse(packet(name))) == packet(name)


@given(original=packets())
@settings(deadline=None, max_examples=300)
def test_any_header_survives_the_way_to_octets_and_back(original):
    assert parse(encode(original)) == original


@given(original=packets(), padding=st.binary(max_size=20))
@settings(deadline=None, max_examples=100)
def test_what_follows_the_payload_is_left_out(original, padding):
    assert parse(encode(original) + padding) == original


def test_header_types_have_the_octets_of_the_standard():
    sizes = {header_type: size for header_type, (_, size) in EXTENDED.items()}
    assert sizes[HeaderType.GUC] == sizes[HeaderType.LS_REPLY] == 48
    assert sizes[HeaderType.TSB] == sizes[HeaderType.SHB] == 28
    assert sizes[HeaderType.GBC_CIRCLE] == sizes[HeaderType.GAC_ELLIPSE] == 44
    assert (sizes[HeaderType.BEACON], sizes[HeaderType.LS_REQUEST]) == (24, 36)


# --- invalid packets ---


@given(original=packets(), data=st.data())
@settings(deadline=None, max_examples=200)
def test_a_packet_cut_off_anywhere_is_refused(original, data):
    octets = encode(original)
    cut = data.draw(st.integers(0, len(octets) - 1))
    with pytest.raises(ProtocolError):
        parse(octets[:cut])


@pytest.mark.parametrize("header_type", [0x11, 0x22, 0x33, 0x43, 0x52, 0x62, 0x70, 0xF0])
def test_a_header_type_that_the_standard_does_not_know_is_refused(header_type):
    octets = bytearray(packet("cam-shb"))
    octets[5] = header_type
    with pytest.raises(ProtocolError, match="in no table"):
        parse(bytes(octets))


@pytest.mark.parametrize("name", SIGNED)
def test_a_secured_packet_is_no_unsecured_one(name):
    with pytest.raises(ProtocolError, match="signed"):
        parse(packet(name))


def test_a_field_too_large_for_its_place_is_not_cut():
    wide = parse(packet("cam-shb"))
    with pytest.raises(struct.error):
        encode(wide._replace(common=wide.common._replace(payload_length=65536)))


# --- lifetime, clause 9.6.4 ---


@pytest.mark.parametrize(
    ("octet", "lifetime"),
    [(0x00, 0), (0x04, 0.05), (0x1A, 60), (0xFC, 3.15), (0x05, 1), (0xFD, 63), (0x06, 10), (0x07, 100), (0xFF, 6300)],
)
def test_a_lifetime_octet_is_a_multiplier_and_a_base(octet, lifetime):
    assert seconds(octet) == pytest.approx(lifetime)


@pytest.mark.parametrize(
    ("lifetime", "octet"),
    [
        (-1, 1 << 2 | 0),
        (0, 1 << 2 | 0),
        (0.05, 1 << 2 | 0),
        (0.06, 1 << 2 | 0),
        (1, 20 << 2 | 0),
        (3.15, 63 << 2 | 0),
        (3.2, 3 << 2 | 1),
        (60, 60 << 2 | 1),
        (59.9999, 60 << 2 | 1),
        (63.4, 63 << 2 | 1),
        (64, 6 << 2 | 2),
        (600, 60 << 2 | 2),
        (640, 6 << 2 | 3),
        (6300, 63 << 2 | 3),
        (1e9, 63 << 2 | 3),
        (float("inf"), 63 << 2 | 3),
    ],
)
def test_a_lifetime_is_coded_in_the_finest_base_that_reaches_it(lifetime, octet):
    assert lifetime_octet(lifetime) == octet


@given(octet=st.integers(4, 255))
@settings(deadline=None, max_examples=252)
def test_a_coded_lifetime_keeps_its_length_when_coded_again(octet):
    assert seconds(lifetime_octet(seconds(octet))) == pytest.approx(seconds(octet))
