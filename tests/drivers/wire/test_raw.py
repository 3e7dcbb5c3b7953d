"""RawRxMessage against the golden vectors and against an interpreter of its ASN.1."""

import asn1tools
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from board.runtime.errors import ProtocolError
from drivers.message import Area, Position, RxInfo, Security, SecurityStatus, Shape
from drivers.wire.raw import RawRx, build, parse

MODULE = """
VC-Container { itu-t(0) identified-organization(4) etsi(0) itsDomain(5) additions(999) vehiclecaptain(0)
  vccontainer(0) version(1) }
DEFINITIONS AUTOMATIC TAGS ::= BEGIN

RawRxMessage ::= SEQUENCE {
  localInfo      LocalInfo OPTIONAL,
  rxInfo         RxInfo,
  payloadSize    INTEGER (0..1500),
  payloadString  OCTET STRING (SIZE(1..1500)) OPTIONAL
}
LocalInfo ::= SEQUENCE { timestamp TimeVal, positionInfo PositionInfo }
RxInfo ::= SEQUENCE {
  timestamp         TimeVal,
  rssi              INTEGER (-32768..32767),
  dataRate          INTEGER (0..65535),
  trafficClassID    INTEGER (0..255),
  remainHopLimit    INTEGER (0..255),
  security          RxSecurity,
  positionInfo      PositionInfo,
  areaTypeInfo      AreaTypeInfo,
  sourceMacAddress  OCTET STRING (SIZE(6))
}
TimeVal ::= SEQUENCE { sec INTEGER (-2147483648..2147483647), usec INTEGER (-2147483648..2147483647) }
RxSecurity ::= SEQUENCE {
  status  ENUMERATED { none(0), invalid-fmt(1), verified-pkt(2), unverifiable-pkt(3) },
  itsAID  INTEGER (0..2113663),
  sspLen  INTEGER (0..255),
  ssp     OCTET STRING (SIZE(32))
}
PositionInfo ::= SEQUENCE {
  latitude   INTEGER (-2147483648..2147483647),
  longitude  INTEGER (-2147483648..2147483647)
}
AreaTypeInfo ::= SEQUENCE {
  type       ENUMERATED { circle(0), rectangle(1), ellipse(2) },
  distanceA  INTEGER (0..65535),
  distanceB  INTEGER (0..65535),
  angle      INTEGER (0..65535)
}

END
"""
CODEC = asn1tools.compile_string(MODULE, "uper")
STATUS = ["none", "invalid-fmt", "verified-pkt", "unverifiable-pkt"]
SHAPE = ["circle", "rectangle", "ellipse"]

PDU = bytes.fromhex("02020000053900010203")
ZERO = (
    "6000000020000000200000000000000000000000000000000000000000000000000000000000000000000000000000000000"
    "200000002000000000000000000000000000000000140240808000014e40004080c0"
)
KNOWN = (
    "7ac013d6a001c2cb5fee40030080400000000000000000000000000000000000000000000000000000000000000000000000"
    "270323aa224dc09000000000000000102030405060140240808000014e40004080c0"
)
RECEIVED_NS = 1_795_182_426_461_613_000
RX = RxInfo(
    rssi_dbm=-71,
    data_rate=12,
    traffic_class=2,
    hop_limit=1,
    position=Position(470585000, 154600000),
    source_mac=bytes.fromhex("010203040506"),
)
LOCAL = (RECEIVED_NS + 2000, Position(-487668616, 114320679))


def unsigned(bits):
    return st.integers(0, 2**bits - 1)


numbers_32 = st.integers(-(2**31), 2**31 - 1)
positions = st.builds(Position, numbers_32, numbers_32)
moments = st.builds(lambda s, us: s * 10**9 + us * 1000, numbers_32, st.integers(0, 999_999))
areas = st.none() | st.builds(
    Area, st.sampled_from(Shape), st.just(Position()), st.integers(1, 65535), unsigned(16), unsigned(16)
)
securities = st.builds(Security, st.sampled_from(SecurityStatus), st.integers(0, 2_113_663), st.binary(max_size=32))
receptions = st.builds(
    RxInfo,
    btp_port=st.none(),  # not in the message
    transport=st.just(""),
    source=st.just(""),
    implausible=st.just(()),
    rssi_dbm=st.none() | st.integers(-32768, 32767).filter(bool),
    data_rate=unsigned(16),
    traffic_class=unsigned(8),
    hop_limit=unsigned(8),
    security=securities,
    position=positions,
    area=areas,
    source_mac=st.binary(min_size=6, max_size=6),
)
locals_ = st.none() | st.tuples(moments, positions)
pdus = st.binary(max_size=40) | st.integers(1, 1500).map(lambda octets: b"\xa5" * octets)


def as_values(pdu, received_ns, rx, local):
    """Return the arguments of build() as a RawRxMessage for asn1tools."""

    def time_and_place(unix_ns, position, key):
        seconds, nanoseconds = divmod(unix_ns, 10**9)
        return {"timestamp": {"sec": seconds, "usec": nanoseconds // 1000}, key: position._asdict()}

    area = rx.area or Area(Shape.CIRCLE, Position(), 0)
    message = {
        "rxInfo": {
            **time_and_place(received_ns, rx.position, "positionInfo"),
            "rssi": rx.rssi_dbm or 0,
            "dataRate": rx.data_rate,
            "trafficClassID": rx.traffic_class,
            "remainHopLimit": rx.hop_limit,
            "security": {
                "status": STATUS[rx.security.status],
                "itsAID": rx.security.its_aid,
                "sspLen": len(rx.security.ssp),
                "ssp": rx.security.ssp.ljust(32, b"\0"),
            },
            "areaTypeInfo": {
                "type": SHAPE[area.shape],
                "distanceA": area.distance_a,
                "distanceB": area.distance_b,
                "angle": area.angle,
            },
            "sourceMacAddress": rx.source_mac,
        },
        "payloadSize": len(pdu),
    }
    if pdu:
        message["payloadString"] = pdu
    if local:
        message["localInfo"] = time_and_place(*local, "positionInfo")
    return message


# --- build ---


def test_a_message_of_which_nothing_is_known_is_the_first_golden_vector():
    assert build(PDU, 0, RxInfo()).hex() == ZERO


def test_a_message_of_which_much_is_known_is_the_second_golden_vector():
    assert build(PDU, RECEIVED_NS, RX).hex() == KNOWN


@given(pdu=pdus, received_ns=moments, rx=receptions, local=locals_)
@settings(deadline=None, max_examples=400)
def test_a_message_has_the_octets_of_its_asn1(pdu, received_ns, rx, local):
    octets = build(pdu, received_ns, rx, local)
    assert octets == CODEC.encode("RawRxMessage", as_values(pdu, received_ns, rx, local))


@pytest.mark.parametrize(("octets", "size"), [(0, 72), (1, 75), (300, 374), (1500, 1574)])
def test_what_is_known_adds_74_octets_and_own_time_and_place_16_more(octets, size):
    assert len(build(bytes(octets), RECEIVED_NS, RX)) == size
    assert len(build(bytes(octets), RECEIVED_NS, RX, LOCAL)) == size + 16


@pytest.mark.parametrize(
    ("wrong", "right"),
    [
        ({"rssi_dbm": -99999}, {"rssi_dbm": -32768}),
        ({"rssi_dbm": 99999}, {"rssi_dbm": 32767}),
        ({"data_rate": 65536}, {"data_rate": 65535}),
        ({"data_rate": -1}, {"data_rate": 0}),
        ({"traffic_class": 256}, {"traffic_class": 255}),
        ({"hop_limit": 1000}, {"hop_limit": 255}),
        ({"position": Position(2**31, -(2**31) - 1)}, {"position": Position(2**31 - 1, -(2**31))}),
        (
            {"area": Area(Shape.ELLIPSE, Position(), 65536, -1, 70000)},
            {"area": Area(Shape.ELLIPSE, Position(), 65535, 0, 65535)},
        ),
        (
            {"security": Security(SecurityStatus.UNVERIFIABLE_PKT, 270549118, b"\x01")},
            {"security": Security(SecurityStatus.UNVERIFIABLE_PKT, 0, b"\x01")},
        ),
        (
            {"security": Security(SecurityStatus.VERIFIED_PKT, 36, bytes(33))},
            {"security": Security(SecurityStatus.VERIFIED_PKT, 36)},
        ),
    ],
)
def test_a_number_out_of_range_is_put_into_its_range(wrong, right):
    wrong, right = RX._replace(**wrong), RX._replace(**right)
    assert build(PDU, RECEIVED_NS, wrong, LOCAL) == build(PDU, RECEIVED_NS, right, LOCAL)


def test_a_moment_beyond_2038_stays_at_the_last_that_can_be_said():
    octets = build(PDU, 2**40 * 10**9, RX, (2**40 * 10**9, Position()))
    assert octets == build(PDU, 2**31 * 10**9 - 1, RX, (2**31 * 10**9 - 1, Position()))


def test_a_pdu_longer_than_1500_octets_is_cut():
    assert build(bytes(1501), 0, RX) == build(bytes(1500), 0, RX)


@given(
    received_ns=st.integers(),
    rx=st.builds(
        RxInfo,
        rssi_dbm=st.integers(),
        data_rate=st.integers(),
        traffic_class=st.integers(),
        hop_limit=st.integers(),
        security=st.builds(Security, st.sampled_from(SecurityStatus), st.integers(), st.binary(max_size=60)),
        position=st.builds(Position, st.integers(), st.integers()),
        area=st.builds(Area, st.sampled_from(Shape), st.just(Position()), *[st.integers()] * 3),
    ),
    own_ns=st.integers(),
)
@settings(deadline=None, max_examples=300)
def test_no_number_makes_build_raise(received_ns, rx, own_ns):
    octets = build(PDU, received_ns, rx, (own_ns, rx.position))
    assert CODEC.decode("RawRxMessage", octets)["payloadString"] == PDU
    assert parse(octets).pdu == PDU


# --- parse ---


def test_the_golden_vectors_are_taken_apart():
    assert parse(bytes.fromhex(ZERO)) == RawRx(PDU, 0, RxInfo(), None)
    assert parse(bytes.fromhex(KNOWN)) == RawRx(PDU, RECEIVED_NS, RX, None)


@given(pdu=pdus, received_ns=moments, rx=receptions, local=locals_)
@settings(deadline=None, max_examples=400)
def test_a_message_survives_the_way_to_octets_and_back(pdu, received_ns, rx, local):
    assert parse(build(pdu, received_ns, rx, local)) == RawRx(pdu, received_ns, rx, local)


def test_what_is_behind_a_message_is_left_out():
    octets = build(PDU, RECEIVED_NS, RX, LOCAL)
    assert parse(octets + b"\xff" * 30) == parse(octets)


@pytest.mark.parametrize("pdu", [b"", b"\x01", PDU])
@pytest.mark.parametrize("local", [None, LOCAL])
def test_a_message_cut_off_at_any_octet_is_refused(pdu, local):
    octets = build(pdu, RECEIVED_NS, RX, local)
    for cut in range(len(octets)):
        with pytest.raises(ProtocolError):
            parse(octets[:cut])


def changed(octets, first_bit, width, value):
    """Return the octets with a field overwritten."""
    shift = len(octets) * 8 - first_bit - width
    number = int.from_bytes(octets) & ~((2**width - 1) << shift)
    return (number | value << shift).to_bytes(len(octets))


@pytest.mark.parametrize(
    ("first_bit", "width", "value", "said"),
    [
        (116, 22, 2_113_664, "itsAID"),
        (138, 8, 33, "sspLen"),
        (466, 2, 3, "unknown type of area"),
        (564, 11, 9, "payloadSize"),
        (564, 11, 1501, "payloadSize"),
        (575, 11, 1500, "payloadSize"),
        (1, 1, 0, "payloadString is absent"),
    ],
)
def test_a_field_that_its_type_does_not_allow_is_refused(first_bit, width, value, said):
    with pytest.raises(ProtocolError, match=said):
        parse(changed(build(PDU, RECEIVED_NS, RX), first_bit, width, value))


@given(octets=st.binary(max_size=200))
@settings(deadline=None, max_examples=1000)
def test_random_octets_are_refused_or_taken_apart(octets):
    try:
        found = parse(octets)
    except ProtocolError as error:
        assert error.message.startswith("RawRxMessage")
    else:
        assert found == parse(build(found.pdu, found.received_ns, found.rx, found.local))
