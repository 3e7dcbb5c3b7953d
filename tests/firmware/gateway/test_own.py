"""Own position and time as ROS has them."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from firmware.gateway.captain_gateway.captain_gateway import own
from firmware.gateway.captain_gateway.captain_gateway.own import clock, east_north_up, pose, quaternion

POSITION = {
    "latitude": 47.06, "longitude": 15.47, "source": "gnss", "carrier": "fixed", "altitude_m": 400.0, "horizontal_m": 2.0,
    "vertical_m": 4.0, "heading_deg": 90.0, "speed_m_s": 10.0,
}  # fmt: skip


def test_a_position_is_read_with_what_the_receiver_knows():
    found = pose({"position": POSITION})
    assert found == (47.06, 15.47, 400.0, 2.0, 4.0, 90.0, 10.0, "gnss", "fixed")


def test_what_the_receiver_does_not_know_is_not_made_up():
    found = pose({"position": {"latitude": 47.06, "longitude": 15.47, "source": "configured"}})
    assert found == (47.06, 15.47, None, None, None, None, None, "configured", "")


@pytest.mark.parametrize(
    "position",
    [
        None,
        [],
        {},
        POSITION | {"source": ""},
        POSITION | {"latitude": None},
        POSITION | {"longitude": float("nan")},
        POSITION | {"latitude": True},
        POSITION | {"latitude": 90.1},
        POSITION | {"longitude": -181},
        POSITION | {"latitude": 10**400},
    ],
)
def test_a_place_that_is_none_is_not_told(position):
    assert pose({"position": position}) is None
    assert pose({}) is None


@pytest.mark.parametrize("wrong", [10**400, 1e200, -1e200, float("inf"), float("nan"), "1", True, [], None])
def test_what_no_receiver_can_mean_is_not_known(wrong):
    names = ("altitude_m", "horizontal_m", "vertical_m", "heading_deg", "speed_m_s")
    found = pose({"position": POSITION | dict.fromkeys(names, wrong)})
    assert found == (47.06, 15.47, None, None, None, None, None, "gnss", "fixed")


@pytest.mark.parametrize(("name", "wrong"), [("horizontal_m", -1.0), ("vertical_m", -1), ("speed_m_s", -0.1)])
def test_a_bound_or_a_speed_is_not_below_nothing(name, wrong):
    assert getattr(pose({"position": POSITION | {name: wrong}}), name) is None


def test_the_time_of_the_station_is_utc():
    # TS 102 894-2, TimestampIts: 2007-01-01T00:00:00Z is 94 694 401 000 ms, one leap second after 2004
    found = clock({"its_ms": 94_694_401_000, "leap": {"seconds": 1}, "receiver": "gnss", "state": "locked"})
    assert found == (1_167_609_600_000_000_000, "gnss, locked", 1)


@pytest.mark.parametrize(
    "told",
    [
        {},
        {"its_ms": None, "leap": {"seconds": 5}},
        {"its_ms": 1, "leap": None},
        {"its_ms": 1 << 60, "leap": {"seconds": 5}},
        {"its_ms": -1, "leap": {"seconds": 5}},
        {"its_ms": 1, "leap": {"seconds": None}},
        {"its_ms": "x", "leap": []},
    ],
)
def test_a_time_that_nobody_knows_is_not_told(told):
    assert clock(told).unix_ns is None


def test_the_map_has_its_axes_east_north_and_up():
    origin = (47.0, 15.0, 400.0)
    assert east_north_up(origin, (47.0, 15.0), 400.0) == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)
    assert east_north_up(origin, (47.0, 15.0), 410.0) == pytest.approx((0.0, 0.0, 10.0), abs=1e-6)
    # A degree of latitude at 47 degrees is 111 170 m, one of longitude 76 055 m (WGS84).
    assert east_north_up(origin, (47.0001, 15.0), 400.0) == pytest.approx((0.0, 11.118, 0.0), abs=0.01)
    assert east_north_up(origin, (47.0, 15.0001), 400.0) == pytest.approx((7.606, 0.0, 0.0), abs=0.01)


@pytest.mark.parametrize(("heading", "yaw"), [(90.0, 0.0), (0.0, 90.0), (180.0, -90.0), (270.0, -180.0)])
def test_a_heading_from_north_is_a_yaw_from_east(heading, yaw):
    z, w = quaternion(heading)
    assert math.degrees(2 * math.atan2(z, w)) == pytest.approx(yaw)


def test_the_constants_are_those_of_wgs84():
    flattening = 1 / 298.257223563
    assert pytest.approx(flattening * (2 - flattening), rel=1e-12) == own.ECCENTRICITY_2


JSON = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=5)
    | st.sampled_from([10**400, -(10**400)]),
    lambda below: (
        st.lists(below, max_size=3) | st.dictionaries(st.sampled_from([*POSITION, "seconds"]), below, max_size=3)
    ),
    max_leaves=5,
)


@given(told=st.dictionaries(st.sampled_from(["position", "its_ms", "leap", "receiver", "state"]), JSON))
def test_whatever_a_station_says_of_itself_is_read_or_passed_by(told):
    pose(told)
    clock(told)
