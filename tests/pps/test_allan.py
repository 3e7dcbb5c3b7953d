"""Allan deviation against noises whose deviation is known, and against the example of NIST SP 1065."""

from itertools import accumulate
from math import sqrt
from random import Random

import pytest

from pps.allan import allan_deviation
from pps.sim.oscillator import START_NS, Oscillator, drawn
from pps.sim.temperature import Temperature

# NIST SP 1065, the test suite of 1000 points: frequencies of a generator that is written down there (n(i+1) = 16807 n(i)
# modulo 2147483647, n(0) = 1234567890, each divided by the modulus), their mean, and their deviation for tau 1.
SEED, FACTOR, MODULUS = 1_234_567_890, 16_807, 2_147_483_647


def nist_frequencies() -> list[float]:
    numbers = accumulate(range(999), lambda n, _: n * FACTOR % MODULUS, initial=SEED)
    return [number / MODULUS for number in numbers]


def phases_ns(frequencies: list[float], tau0_s: float = 1.0) -> list[float]:
    return [0.0, *accumulate(y * tau0_s * 1e9 for y in frequencies)]


def test_it_is_what_the_example_of_nist_says():
    assert sum(nist_frequencies()) / 1000 == pytest.approx(0.4897745, rel=1e-6)  # the table's own check of the input
    deviations = dict(allan_deviation(phases_ns(nist_frequencies())))
    assert deviations[1] == pytest.approx(0.2922319, rel=1e-6)


def test_a_constant_frequency_has_none():
    assert all(deviation < 1e-18 for _, deviation in allan_deviation([1000.0 * s for s in range(1000)]))


def test_a_steady_drift_is_seen_in_proportion_to_the_span():
    drift = 1e-10  # per second
    for tau_s, deviation in allan_deviation([0.5 * drift * 1e9 * s * s for s in range(5000)]):
        assert deviation == pytest.approx(drift * tau_s / sqrt(2), rel=1e-6)


def test_white_noise_of_the_frequency_falls_with_the_root_of_the_span():
    random = Random(1)
    phases = phases_ns([random.gauss(0, 1e-9) for _ in range(20_000)])
    for tau_s, deviation in allan_deviation(phases)[:8]:
        assert deviation == pytest.approx(1e-9 / sqrt(tau_s), rel=0.15)


def test_white_noise_of_the_phase_falls_with_the_span():
    random = Random(2)
    for tau_s, deviation in allan_deviation([random.gauss(0, 500) for _ in range(20_000)])[:8]:
        assert deviation == pytest.approx(sqrt(3) * 500e-9 / tau_s, rel=0.1)


def test_spans_are_octaves_of_the_interval_up_to_a_quarter_of_the_whole():
    assert [tau_s for tau_s, _ in allan_deviation([0.0] * 100, tau0_s=10)] == [10, 20, 40, 80, 160]
    assert allan_deviation([0.0] * 4) == []
    assert allan_deviation([]) == []


def test_a_simulated_crystal_is_of_the_class_of_a_single_board_computer():
    # Short spans: 1e-9 or so; at a thousand seconds and beyond, some 1e-8 by temperature.
    clock = Oscillator(drawn(5), Temperature(), 5)
    phases = [float(clock.raw_ns(START_NS + s * 10**9) - clock.start_raw_ns - s * 10**9) for s in range(43_200)]
    deviations = dict(allan_deviation(phases))
    assert 1e-10 < deviations[1] < 1e-8
    assert 1e-9 < deviations[4096] < 3e-7
