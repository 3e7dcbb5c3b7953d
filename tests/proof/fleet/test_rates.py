"""Rates of messages, compared with the standards' rules step by step."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.proof.fleet.rates import CAM, CAM_LOW_FREQUENCY, CPM, DENM, cam_checks, rates, recorded
from tests.proof.fleet.region import CITY, Vehicle, traffic

SPEEDS = st.floats(0, 60)
CHANGES = st.floats(-8, 8)
YAWS = st.floats(-60, 60)


def played(speed: float, acceleration: float, yaw: float) -> int:
    """Checks until EN 302 637-2, 6.1.3 makes a CAM, one after the other."""
    for check in range(1, 10):
        elapsed = 0.1 * check
        if speed * elapsed > 4 or abs(acceleration) * elapsed > 0.5 or abs(yaw) * elapsed > 4:
            return check
    return 10  # T_GenCamMax


def near_threshold(speed: float, acceleration: float, yaw: float) -> bool:
    """Where the last bit of a float decides."""
    changes = ((4, speed), (0.5, abs(acceleration)), (4, abs(yaw)))
    waits = [limit / 0.1 / change for limit, change in changes if change > 1e-6]
    return any(abs(wait - round(wait)) < 1e-9 for wait in waits)


@given(speed=SPEEDS, acceleration=CHANGES, yaw=YAWS)
def test_a_CAM_is_made_when_the_rules_played_step_by_step_make_it(
    speed: float, acceleration: float, yaw: float
) -> None:
    assert cam_checks(speed, acceleration, yaw) == played(speed, acceleration, yaw) or near_threshold(
        speed, acceleration, yaw
    )


@pytest.mark.parametrize(
    ("speed", "acceleration", "yaw", "hz"),
    [
        (0, 0, 0, 1.0),  # T_GenCamMax
        (13.9, 0, 0, 1 / 0.3),  # 50 km/h: 4.17 m in 0.3 s
        (33.3, 0, 0, 5.0),  # 120 km/h: 6.66 m in 0.2 s
        (45, 0, 0, 10.0),  # 162 km/h: 4.5 m in 0.1 s
        (0, 2.0, 0, 1 / 0.3),  # 0.6 m/s in 0.3 s
        (5, 0, 25, 5.0),  # 5 degrees in 0.2 s
    ],
)
def test_the_rate_of_a_CAM_follows_the_vehicle(speed: float, acceleration: float, yaw: float, hz: float) -> None:
    found = rates(Vehicle(0, 0, speed, acceleration, yaw, 0, CITY), 1)
    assert found.cam + found.cam_low_frequency == pytest.approx(hz)


@given(speed=SPEEDS, acceleration=CHANGES, yaw=YAWS, around=st.floats(0, 100), number=st.integers(0, 10**6))
def test_all_rates_stay_within_those_of_the_standards(
    speed: float, acceleration: float, yaw: float, around: float, number: int
) -> None:
    found = rates(Vehicle(0, 0, speed, acceleration, yaw, around, CITY), number)
    assert 1.0 <= found.cam + found.cam_low_frequency <= 10.0 + 1e-9
    assert 0 < found.cam_low_frequency <= 2.0 + 1e-9  # 500 ms
    assert found.cpm == 0 or 1.0 <= found.cpm <= 10.0 + 1e-9
    assert found.total == pytest.approx(sum(hz for _, hz in found.by_message))


def test_the_messages_that_are_counted_have_that_length() -> None:
    pdus = recorded()
    assert all(len(pdus[message]) == message[1] for message in (CAM, CAM_LOW_FREQUENCY, DENM, CPM))


def test_the_same_seed_is_the_same_traffic_and_another_is_another() -> None:
    assert traffic(1, 300) == traffic(1, 300)
    assert traffic(1, 300) != traffic(2, 300)


def test_the_city_is_hot_and_the_country_open() -> None:
    vehicles = traffic(1, 5000)
    inside = sum(math.hypot(vehicle.x, vehicle.y) < 2 for vehicle in vehicles) / (math.pi * 4)
    outside = sum(math.hypot(vehicle.x, vehicle.y) > 20 for vehicle in vehicles) / (64 * 64 - math.pi * 400)
    assert inside > 100 * outside
    assert all(abs(vehicle.x) <= 32 and abs(vehicle.y) <= 32 and vehicle.speed >= 0 for vehicle in vehicles)


def test_vehicles_are_slower_where_there_are_more() -> None:
    moving = [vehicle for vehicle in traffic(1, 5000) if vehicle.kind is CITY and vehicle.speed]
    moving.sort(key=lambda vehicle: vehicle.around)
    few, many = moving[: len(moving) // 4], moving[-len(moving) // 4 :]
    assert sum(v.speed for v in few) / len(few) > 1.5 * sum(v.speed for v in many) / len(many)
