"""EN 302 637-2 V1.4.1 clause 6.1.3: when CAMs are generated."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.sim.track import METRES, Motion
from firmware.swarm.generation import CHECK_S, MAX_S, MIN_S, Generation

EQUATOR = Motion(0, 0, 0, 0, 0)


def north(metres: float, speed_m_s: float = 0.0, heading: float = 0.0) -> Motion:
    return Motion(round(metres / METRES * 1e7), 0, 0, round(speed_m_s * 1000), round(heading * 1e5) % 36_000_000)


def generated(motions: list[Motion], dcc_s: float = MIN_S) -> list[int]:
    """The checks, 100 ms apart, at which there was a CAM."""
    rules = Generation(dcc_s)
    return [at for at, motion in enumerate(motions) if rules.is_due(at * CHECK_S, motion)]


def test_a_vehicle_that_stands_sends_one_a_second():
    assert generated([EQUATOR] * 41) == [0, 10, 20, 30, 40]


@pytest.mark.parametrize(
    ("speed", "checks"),
    [(50.0, 1), (30.0, 2), (13.9, 3), (10.1, 4), (4.7, 9), (4.2, 10)],
)
def test_a_vehicle_that_drives_straight_sends_one_for_each_four_metres(speed: float, checks: int):
    times = generated([north(at * 0.1 * speed, speed) for at in range(101)])
    assert {later - one for one, later in pairwise(times)} == {checks}


def test_a_turn_of_more_than_four_degrees_asks_for_one():
    assert generated([north(0, 0, 0), north(0, 0, 4.0), north(0, 0, 4.1), north(0, 0, 8.0), north(0, 0, 8.2)]) == [
        0,
        2,
        4,
    ]


def test_a_turn_across_north_is_as_small_as_any():
    assert generated([north(0, 0, 359), north(0, 0, 1), north(0, 0, 3.5)]) == [0, 2]


def test_half_a_metre_a_second_more_or_less_asks_for_one():
    assert generated([north(0, 10), north(0, 10.5), north(0, 10.6), north(0, 10.2), north(0, 10.0)]) == [0, 2, 4]


def test_three_follow_as_fast_as_the_one_that_movement_asked_for():
    # A jump after 300 ms, then standstill: T_GenCam is 300 ms for N_GenCam = 3 CAMs, then 1 s again.
    motions = [north(0)] * 3 + [north(10)] * 40
    assert generated(motions) == [0, 3, 6, 9, 12, 22, 32, 42]


def test_the_load_of_the_channel_stretches_them():
    motions = [north(at * 5.0) for at in range(31)]
    assert generated(motions, dcc_s=0.5) == [0, 5, 10, 15, 20, 25, 30]


@given(
    steps=st.lists(st.tuples(st.floats(0, 10), st.floats(0, 50), st.floats(0, 360)), min_size=2, max_size=100),
    dcc_s=st.floats(0.0, 2.0),
)
def test_never_faster_than_ten_nor_slower_than_one_a_second(steps, dcc_s):
    way, motions = 0.0, []
    for metres, speed, heading in steps:
        way += metres
        motions.append(north(way, speed, heading))
    times = generated(motions, dcc_s)
    gaps = [later - one for one, later in pairwise(times)]
    least = min(max(dcc_s, MIN_S), MAX_S) / CHECK_S
    assert all(least - 0.01 <= gap <= 10 for gap in gaps)
    assert len(motions) - times[-1] <= 10


def test_the_low_frequency_container_is_in_the_first_and_in_one_each_half_second():
    rules = Generation()
    assert [rules.has_low_frequency(at * 0.1) for at in range(12)] == [at % 5 == 0 for at in range(12)]
    assert [rules.has_low_frequency(2 + at * 0.3) for at in range(5)] == [True, False, True, False, True]
