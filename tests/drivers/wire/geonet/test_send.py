"""Sent packets: single hop broadcasts, GeoBroadcasts, beacons after silence."""

from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from board.runtime.errors import RequestError
from board.time.scales import gn_timestamp
from drivers.message import Area, Ego, MessageType, Position, Request, Shape
from drivers.wire.geonet.header import Address, HeaderType, LongPosition, seconds
from drivers.wire.geonet.packet import Beacon, GeoArea, SingleHop, parse
from drivers.wire.geonet.protocol import GeoNetworking, Heard, Mib, Received
from tests.drivers.wire.captured import HERE, INGOLSTADT, NEIGHBOUR, NOWHERE, OWN, ethernet, packet, tshark

CAM = MessageType("cam", 2, 2001, 3, 0)
PDU = bytes.fromhex("02020000053900010203")
REQUEST = Request(1, CAM, PDU, 2001, accepted=0.0, deadline=60.0, priority=3, traffic_class=2)
AREA = Area(Shape.ELLIPSE, INGOLSTADT, 500, 200, 45)


def station(**options):
    return GeoNetworking(OWN, Mib(**options))


def broadcast(area=AREA, hop_limit=10, core=None, now=0.0, **otherwise):
    request = REQUEST._replace(area=area, hop_limit=hop_limit, **otherwise)
    return parse((core or station()).encode(request, now, HERE))


# --- single hop ---


def test_a_request_without_an_area_leaves_as_a_single_hop_broadcast():
    sent = parse(station().encode(REQUEST, 0.0, HERE))
    basic, common = sent.basic, sent.common
    assert (basic.version, basic.next_header, basic.reserved, basic.hop_limit) == (1, 1, 0, 1)
    assert seconds(basic.lifetime) == CAM.lifetime == 1
    assert (common.next_header, common.header_type, common.max_hop_limit) == (2, HeaderType.SHB, 1)
    assert (common.traffic_class, common.flags, common.reserved, common.reserved_2) == (2, 0x80, 0, 0)
    assert sent.payload == bytes.fromhex("07d10000") + PDU
    source = LongPosition(Address(False, 0, 0, OWN), 757_886_011, INGOLSTADT.latitude, INGOLSTADT.longitude, True, 0, 0)
    assert sent.extended == SingleHop(source)
    assert source.timestamp == gn_timestamp(HERE.its_ms)


def test_the_same_station_and_time_give_the_octets_of_the_captured_station():
    # In the captured packet `cam-shb`, the longitude in the position vector is one unit less than in the CAM.
    core = GeoNetworking(bytes.fromhex("02000000000b"), Mib(is_mac_configured=True))
    ego = Ego(168 * 2**32 + 757_810_499, Position(487668616, 114320679), True)
    kind = CAM._replace(lifetime=60.0)
    request = REQUEST._replace(kind=kind, pdu=parse(packet("cam-shb")).payload[4:], traffic_class=0)
    # The captured packet encodes the lifetime as 6 x 10 s, this station as 60 x 1 s.
    assert core.encode(request, 0.0, ego) == packet("cam-shb").replace(b"\x11\x00\x1a", b"\x11\x00\xf1", 1)


def test_the_station_type_stands_in_the_address():
    sent = parse(station(station_type=5).encode(REQUEST, 0.0, HERE))
    assert sent.extended.source.address == Address(False, 5, 0, OWN)


@pytest.mark.parametrize("is_configured", [True, False])
def test_the_address_says_whether_it_was_configured(is_configured):
    sent = parse(station(is_mac_configured=is_configured).encode(REQUEST, 0.0, HERE))
    assert sent.extended.source.address == Address(is_configured, 0, 0, OWN)


def test_a_station_that_does_not_move_says_so_in_everything_it_sends():
    core = station(is_mobile=False)
    packets = [core.encode(REQUEST, 0.0, HERE), core.encode(REQUEST._replace(area=AREA), 0.0, HERE)]
    core.expire(100.0)
    packets.append(core.take(HERE))
    assert [parse(octets).common.flags for octets in packets] == [0, 0, 0]


def test_an_unknown_position_is_marked_as_inaccurate():
    source = parse(station().encode(REQUEST, 0.0, NOWHERE)).extended.source
    assert (source.is_accurate, source.latitude, source.longitude) == (False, 0, 0)


def test_a_position_of_unknown_accuracy_is_sent_and_marked_as_inaccurate():
    source = parse(station().encode(REQUEST, 0.0, HERE._replace(is_accurate=False))).extended.source
    assert (source.latitude, source.is_accurate) == (HERE.position.latitude, False)


@pytest.mark.parametrize(
    ("speed", "sent"), [(0, 0), (1389, 1389), (-500, -500), (16383, 16383), (99999, 16383), (-99999, -16384)]
)
def test_a_speed_beyond_its_15_bits_becomes_the_largest(speed, sent):
    source = parse(station().encode(REQUEST, 0.0, HERE._replace(speed=speed))).extended.source
    assert (source.speed, source.is_accurate) == (sent, True)


@pytest.mark.parametrize(("heading", "sent"), [(0, 0), (3599, 3599), (3600, 0), (-10, 3590)])
def test_a_heading_stays_below_a_full_turn(heading, sent):
    assert parse(station().encode(REQUEST, 0.0, HERE._replace(heading=heading))).extended.source.heading == sent


def test_a_neighbour_receives_what_is_sent():
    for request in (REQUEST, REQUEST._replace(area=AREA, hop_limit=5)):
        octets = station().encode(request, 0.0, HERE)
        event = GeoNetworking(NEIGHBOUR).receive(octets, OWN, 0.0, HERE.its_ms, lambda: HERE)
        assert isinstance(event, Received)
        assert event.pdu == PDU
        assert (event.rx.btp_port, event.rx.traffic_class, event.rx.area) == (2001, 2, request.area)


# --- GeoBroadcast ---


@pytest.mark.parametrize("shape", Shape)
def test_a_request_with_an_area_leaves_as_a_geobroadcast(shape):
    sent = broadcast(AREA._replace(shape=shape))
    assert sent.common.header_type == HeaderType.GBC_CIRCLE + shape
    assert (sent.basic.hop_limit, sent.common.max_hop_limit) == (10, 10)
    body = sent.extended
    assert isinstance(body, GeoArea)
    assert (body.latitude, body.longitude, body.distance_a) == (*INGOLSTADT, 500)
    assert (body.distance_b, body.angle) == ((0, 0) if shape is Shape.CIRCLE else (200, 45))
    assert sent.payload == bytes.fromhex("07d10000") + PDU


@pytest.mark.parametrize(("now", "lifetime"), [(0.0, 60), (50.0, 10), (59.0, 1), (59.96, 0.05), (59.999, 0.05)])
def test_the_lifetime_of_a_geobroadcast_is_what_is_left_of_the_request(now, lifetime):
    assert seconds(broadcast(now=now).basic.lifetime) == pytest.approx(lifetime)


def test_each_geobroadcast_has_the_next_sequence_number():
    core = station()
    request = REQUEST._replace(area=AREA)
    numbers = [core.encode(request, 0.0, HERE)[12:14] for _ in range(65537)]
    assert numbers == [(number & 0xFFFF).to_bytes(2) for number in range(65537)]


def test_a_single_hop_broadcast_takes_no_sequence_number():
    core = station()
    broadcast(core=core)
    core.encode(REQUEST, 0.0, HERE)
    assert broadcast(core=core).extended.sequence == 1


@pytest.mark.parametrize(
    "wrong",
    [
        {"area": AREA._replace(distance_a=65536)},
        {"area": AREA._replace(distance_b=-1)},
        {"area": AREA._replace(angle=70000)},
        {"area": AREA._replace(centre=Position(2**31, 0))},
        {"hop_limit": 256},
        {"hop_limit": -1},
        {"traffic_class": 256},
        {"btp_port": 65536},
        {"pdu": bytes(65536)},
    ],
)
def test_a_number_that_does_not_fit_its_header_is_the_users_mistake(wrong):
    core = station()
    with pytest.raises(RequestError, match="GeoNetworking"):
        broadcast(core=core, **wrong)
    assert core.deadline() == 0.0  # nothing was sent
    assert broadcast(core=core).extended.sequence == 0


@given(
    traffic_class=st.integers(0, 255),
    hop_limit=st.integers(0, 255),
    port=st.integers(0, 65535),
    pdu=st.binary(max_size=1500),
    area=st.none()
    | st.builds(
        Area,
        st.sampled_from(Shape),
        st.builds(Position, st.integers(-900000000, 900000000), st.integers(-1800000000, 1800000000)),
        *[st.integers(0, 65535)] * 3,
    ),
)
@settings(deadline=None, max_examples=200)
def test_every_request_within_its_ranges_is_sent_whole(traffic_class, hop_limit, port, pdu, area):
    request = REQUEST._replace(traffic_class=traffic_class, hop_limit=hop_limit, btp_port=port, pdu=pdu, area=area)
    sent = parse(station().encode(request, 0.0, HERE))
    assert sent.payload[4:] == pdu
    assert int.from_bytes(sent.payload[:2]) == port
    assert sent.common.traffic_class == traffic_class


def test_tshark_finds_nothing_wrong_with_what_is_sent(tmp_path):
    core = station()
    core.expire(0.0)
    core.expire(10.0)
    frames = [core.take(HERE), core.encode(REQUEST._replace(btp_port=42), 0.0, HERE)]
    for shape in Shape:
        request = REQUEST._replace(btp_port=42, area=AREA._replace(shape=shape), hop_limit=10)
        frames.append(core.encode(request, 0.0, HERE))
    shown = tshark([ethernet(frame) for frame in frames], tmp_path)
    assert [int(fields["geonw.ch.htype"], 0) for fields in shown] == [0x10, 0x50, 0x40, 0x41, 0x42]
    for fields in shown:
        assert not {"geonw.reserved_not_zero", "_ws.malformed", "geonw.position_oor"} & set(fields)


# --- beacons ---


def test_a_beacon_is_due_after_silence_and_not_before():
    core = station(beacon_s=3.0)
    assert core.deadline() == 0.0
    assert not core.expire(100.0)
    assert core.take(HERE) == b""
    due = core.deadline()
    assert 103.0 <= due < 103.75
    assert not core.expire(due - 0.001)
    assert core.take(HERE) == b""
    assert core.expire(due)
    assert core.take(HERE)
    assert core.take(HERE) == b""


def test_a_beacon_says_who_and_where():
    core = station()
    core.expire(0.0)
    core.expire(10.0)
    octets = core.take(HERE)
    sent = parse(octets)
    assert len(octets) == 36
    assert isinstance(sent.extended, Beacon)
    assert sent.extended.source.address.mac == OWN
    assert (sent.basic.hop_limit, sent.common.max_hop_limit, sent.common.next_header) == (1, 1, 0)
    assert sent.payload == b""
    assert GeoNetworking(NEIGHBOUR).receive(octets, OWN, 0.0, HERE.its_ms, lambda: HERE) == Heard(OWN)


def test_every_packet_sent_begins_the_silence_anew():
    core = station(beacon_s=3.0)
    core.expire(0.0)
    for now in range(1, 20):
        core.encode(REQUEST, float(now), HERE)
        assert core.deadline() >= now + 3.0
        assert not core.expire(float(now))


def test_beacons_follow_each_other_with_a_jitter_of_at_most_a_quarter():
    core = station(beacon_s=4.0)
    core.expire(0.0)
    times = [0.0]
    for _ in range(50):
        times.append(core.deadline())
        assert core.expire(times[-1])
        core.take(HERE)
    gaps = [later - earlier for earlier, later in pairwise(times)]
    assert all(4.0 <= gap <= 5.0 for gap in gaps)
    assert len(set(gaps)) > 40


def test_two_stations_that_start_together_do_not_send_beacons_together():
    one, other = GeoNetworking(OWN), GeoNetworking(NEIGHBOUR)
    one.expire(0.0)
    other.expire(0.0)
    assert one.deadline() != other.deadline()


def test_a_station_without_beacons_has_no_deadline():
    core = station(beacon_s=0.0)
    assert core.deadline() is None
    assert not core.expire(1e9)
    assert core.take(HERE) == b""
