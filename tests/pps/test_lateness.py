"""Which pulses are believed."""

from random import Random

import pytest

from pps.lateness import LATE, RUN, Lateness


def gate(mean_ns: float = 400.0) -> Lateness:
    return Lateness(mean_ns)


def test_ordinary_pulses_are_believed_as_they_are():
    assert [gate().believed_ns(late_ns) for late_ns in (0.0, 900.0, -900.0, -2_500.0)] == [0.0, 900.0, -900.0, -2_500.0]


def test_one_that_waited_is_put_aside_and_leaves_no_doubt():
    lateness = gate()
    assert lateness.believed_ns(40_000) is None
    assert lateness.doubt_ns == 0
    assert lateness.believed_ns(100) == 100


def test_two_of_different_size_are_doubted_by_the_lesser():
    lateness = gate()
    assert [lateness.believed_ns(late_ns) for late_ns in (90_000, 40_000)] == [None, None]
    assert lateness.doubt_ns == 40_000
    assert lateness.believed_ns(0) == 0
    assert lateness.doubt_ns == 0


def test_of_four_in_a_row_the_least_is_believed():
    lateness = gate()
    seen = [lateness.believed_ns(late_ns) for late_ns in (90_000, 40_000, 70_000, 60_000)]
    assert seen == [None] * (RUN - 1) + [40_000]


@pytest.mark.parametrize("sign", [1, -1])
def test_a_clock_that_turns_is_followed_from_its_second_pulse_on(sign: int):
    lateness = gate()
    turn = [sign * late_ns for late_ns in (3_500, 4_500, 6_000, 8_000, 11_000)]
    assert [lateness.believed_ns(late_ns) for late_ns in turn] == [None, *[sign * 3_500], *turn[2:]]
    assert lateness.believed_ns(90_000) is None  # one that waited, amid the turn


def test_the_mean_is_that_of_ordinary_pulses_while_a_third_of_all_wait():
    random, lateness = Random(1), gate(2_000)
    for _ in range(5_000):
        waited = random.expovariate(1 / 40_000) if random.random() < 0.33 else 0.0
        lateness.believed_ns(random.gauss(0, 500) + waited)
    assert 300 < lateness.mean_ns < 1_000
    assert lateness.deviation_ns == 1.25 * lateness.mean_ns


def test_it_learns_how_noisy_pulses_are():
    random, lateness = Random(1), gate(100)
    for _ in range(2_000):
        lateness.believed_ns(random.gauss(0, 100_000))
    assert lateness.deviation_ns == pytest.approx(100_000, rel=0.3)
    assert lateness.believed_ns(LATE * 70_000) is not None
