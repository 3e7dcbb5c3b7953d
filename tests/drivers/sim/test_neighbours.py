"""Simulated neighbours: position, motion and time in CAM, DENM and GeoNetworking header."""

import math
import socket
from collections import defaultdict
from collections.abc import Sequence
from typing import Any, NamedTuple

import pytest

from board.runtime.free_udp import free_udp
from board.time.scales import gn_timestamp, nearest_its_time_ms
from drivers.message import Position
from drivers.sim.neighbours import Neighbour, Neighbours
from drivers.sim.options import NeighboursOptions
from drivers.wire import frame
from drivers.wire.geonet import packet
from firmware.codec.library import load
from tests.virtual import VirtualLoop

NOON = 1_795_176_000.0  # 2026-11-20T12:00:00Z
TEN_MINUTES = 600
SPEED_LIMIT_M_S = 36.2  # 130 km/h
CAM, DENM = 2, 1


class State(NamedTuple):
    """Motion of a station by one source: seconds, degrees, m/s."""

    time_s: float
    position: Position
    speed: float
    heading: float


class Heard(NamedTuple):
    """A frame of a neighbour. its_ms: ITS time when it was sent."""

    header: packet.LongPosition
    message: dict[str, Any]
    its_ms: int


def parsed(octets: bytes, its_ms: int) -> Heard:
    """Return the position vector and the decoded message of a frame."""
    unwrapped = frame.unwrap(octets)
    assert isinstance(unwrapped, frame.Ethernet)
    found = packet.parse(unwrapped.packet)
    assert found.extended is not None
    pdu = found.payload[4:]
    edition = {CAM: "cam-1.4.1", DENM: "denm-1.3.1"}[pdu[1]]
    return Heard(found.extended.source, load().find(edition).decode(pdu), its_ms)


@pytest.fixture(scope="module")
def heard() -> dict[str, dict[int, list[Heard]]]:
    """Return what the simulated board's neighbours send in ten virtual minutes: by message, then by station."""
    loop = VirtualLoop(now=12345.6)
    (listen,) = map(str, free_udp("127.0.0.1", 1))
    found: dict[str, dict[int, list[Heard]]] = {"cam": defaultdict(list), "denm": defaultdict(list)}

    def its_ms() -> int:
        return nearest_its_time_ms(NOON + loop.now)

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as radio:
        radio.bind(("127.0.0.1", 0))
        radio.settimeout(1.0)
        to = "{}:{}".format(*radio.getsockname())
        neighbours = Neighbours(loop, NeighboursOptions(listen=listen, to=to), lambda: NOON + loop.now)
        neighbours.start()
        end = loop.now + TEN_MINUTES
        taken = 0
        while loop.now < end:
            loop.turn()
            while taken < neighbours.sent.total():
                one = parsed(radio.recv(2048), its_ms())
                found["cam" if "cam" in one.message else "denm"][one.message["header"]["stationID"]].append(one)
                taken += 1
        neighbours.stop()
    return found


def by_header(one: Heard) -> State:
    return State(
        one.header.timestamp / 1000,
        Position(one.header.latitude, one.header.longitude),
        one.header.speed / 100,
        one.header.heading / 10,
    )


def by_cam(one: Heard) -> State:
    place, fast = _parts(one)
    return State(
        one.message["cam"]["generationDeltaTime"] / 1000,
        Position(place["latitude"], place["longitude"]),
        fast["speed"]["speedValue"] / 100,
        fast["heading"]["headingValue"] / 10,
    )


def _parts(one: Heard) -> tuple[dict[str, Any], dict[str, Any]]:
    parameters = one.message["cam"]["camParameters"]
    return parameters["basicContainer"]["referencePosition"], parameters["highFrequencyContainer"][1]


def moved(one: Position, other: Position) -> tuple[float, float]:
    """Return the metres to the north and to the east on the WGS84 ellipsoid, for distances of some metres."""
    latitude = math.radians((one.latitude + other.latitude) / 2e7)
    flat = 1 - 0.00669438 * math.sin(latitude) ** 2
    meridian, parallel = 6_378_137 * 0.99330562 / flat**1.5, 6_378_137 / math.sqrt(flat) * math.cos(latitude)
    return (
        meridian * math.radians((other.latitude - one.latitude) / 1e7),
        parallel * math.radians((other.longitude - one.longitude) / 1e7),
    )


def turned(one: float, other: float) -> float:
    """Return the angle between two directions in degrees."""
    return abs((one - other + 180) % 360 - 180)


def errors(states: Sequence[State], modulo_s: float) -> tuple[float, float, float]:
    """Return metres driven, the relative error of speed times time, and the largest error of the heading in degrees."""
    driven = reported = worst = 0.0
    for last, one, after in zip(states, states[1:], states[2:], strict=False):
        driven += math.hypot(*moved(last.position, one.position))
        reported += last.speed * ((one.time_s - last.time_s) % modulo_s)
        north, east = moved(last.position, after.position)  # parallel to the tangent at the point in the middle
        worst = max(worst, turned(math.degrees(math.atan2(east, north)), one.heading))
    return driven, abs(reported / driven - 1), worst


@pytest.mark.parametrize(("state", "modulo_s"), [(by_cam, 65.536), (by_header, 2**32 / 1000)], ids=["cam", "header"])
def test_speed_and_heading_over_ten_minutes_are_those_of_the_positions(
    heard: dict[str, dict[int, list[Heard]]], state: Any, modulo_s: float
) -> None:
    assert len(heard["cam"]) == 2
    for station, all_of_one in heard["cam"].items():
        assert len(all_of_one) >= 10 * TEN_MINUTES - 1
        driven, of_distance, of_heading = errors([state(one) for one in all_of_one], modulo_s)
        print(f"{station}: {driven:.0f} m; distance within {of_distance:.2%}, heading within {of_heading:.2f} degrees")
        assert driven > 5000
        assert of_distance < 0.05
        assert of_heading < 3


def test_the_distance_of_each_two_seconds_is_that_of_the_speed(heard: dict[str, dict[int, list[Heard]]]) -> None:
    for all_of_one in heard["cam"].values():
        states = [by_cam(one) for one in all_of_one]
        for one, after in zip(states, states[20:], strict=False):
            assert math.hypot(*moved(one.position, after.position)) == pytest.approx(2 * one.speed, rel=0.05)


def test_cam_and_header_of_a_frame_agree_in_all_fields(heard: dict[str, dict[int, list[Heard]]]) -> None:
    for one in (one for all_of_one in heard["cam"].values() for one in all_of_one):
        assert by_cam(one)[1:] == by_header(one)[1:]
        assert one.header.timestamp == gn_timestamp(one.its_ms)
        assert one.message["cam"]["generationDeltaTime"] == one.its_ms % 65536
        kind = one.message["cam"]["camParameters"]["basicContainer"]["stationType"]
        assert one.header.address.station_type == kind
        assert one.header.is_accurate


def test_curvature_yaw_rate_and_lateral_acceleration_are_those_of_the_path(
    heard: dict[str, dict[int, list[Heard]]],
) -> None:
    for all_of_one in heard["cam"].values():
        for one, after in zip(all_of_one, all_of_one[10:], strict=False):
            _, fast = _parts(one)
            speed, rate = by_cam(one).speed, fast["yawRate"]["yawRateValue"] / 100
            assert rate < 0  # to the right
            rotated = turned(by_cam(after).heading, by_cam(one).heading)  # in one second
            assert rotated == pytest.approx(-rate, abs=0.15)  # headings are in steps of 0.1 degree
            curvature = fast["curvature"]["curvatureValue"] / 1e4
            assert speed * curvature == pytest.approx(math.radians(rate), rel=0.02)
            lateral = fast["lateralAcceleration"]["lateralAccelerationValue"] / 10
            assert speed**2 * curvature == pytest.approx(lateral, abs=0.05)


def test_denm_names_an_event_on_the_path_with_time_and_heading_of_its_frame(
    heard: dict[str, dict[int, list[Heard]]],
) -> None:
    for station, all_of_one in heard["denm"].items():
        assert len(all_of_one) >= TEN_MINUTES - 1
        for one in all_of_one:
            management, location = one.message["denm"]["management"], one.message["denm"]["location"]
            header = by_header(one)
            event = Position(management["eventPosition"]["latitude"], management["eventPosition"]["longitude"])
            assert event == header.position
            assert management["detectionTime"] == management["referenceTime"] == one.its_ms
            assert management["actionID"]["originatingStationID"] == station
            assert location["eventPositionHeading"]["headingValue"] / 10 == header.heading


def test_trace_of_a_denm_is_the_path_of_the_cams_before_it(heard: dict[str, dict[int, list[Heard]]]) -> None:
    for station, denms in heard["denm"].items():
        cams = {one.its_ms: by_cam(one).position for one in heard["cam"][station]}
        last = denms[-1]
        place = last.message["denm"]["management"]["eventPosition"]
        latitude, longitude = place["latitude"], place["longitude"]
        (trace,) = last.message["denm"]["location"]["traces"]
        assert len(trace) == 40
        its_ms = last.its_ms
        for point in trace:
            its_ms -= 10 * point["pathDeltaTime"]
            latitude += point["pathPosition"]["deltaLatitude"]
            longitude += point["pathPosition"]["deltaLongitude"]
            nearest = min(cams, key=lambda time, wanted=its_ms: abs(time - wanted))
            assert abs(nearest - its_ms) <= 50  # CAMs come ten times a second
            assert math.hypot(*moved(Position(latitude, longitude), cams[nearest])) < 0.6


@pytest.mark.parametrize("number", [0, 1, 49, 199])
def test_a_neighbour_of_any_number_keeps_the_speed_limit_and_has_known_values(number: int) -> None:
    one = parsed(Neighbour(number, NeighboursOptions()).cam(1000.0, 722_000_012_345), 722_000_012_345)
    place, fast = _parts(one)
    assert by_cam(one).speed < SPEED_LIMIT_M_S
    assert place["altitude"]["altitudeValue"] == 42_000
    assert 0 < -fast["curvature"]["curvatureValue"] < 1023
    assert fast["curvatureCalculationMode"] == "yawRateUsed"


def test_a_neighbour_near_the_pole_marks_a_difference_that_its_field_cannot_hold_as_unavailable() -> None:
    one = Neighbour(199, NeighboursOptions(latitude=89.0))
    differences = set()
    for now in range(0, 440, 40):  # one lap
        (trace,) = parsed(one.denm(now, 722_000_012_345), 722_000_012_345).message["denm"]["location"]["traces"]
        differences |= {point["pathPosition"]["deltaLongitude"] for point in trace}
    assert 131_072 in differences
