"""Estimate beside the truth, on simulated days of which it knows nothing; pytest -s prints the figures."""

import pickle
from collections.abc import Sequence
from typing import NamedTuple

import pytest

from board.time.leaps import BUILT_IN
from board.time.scales import LeapEvent, Lock, TimeQuality
from pps.quality import Estimator
from pps.sim.interrupts import Edges, Interrupts
from pps.sim.machine import Machine
from pps.sim.oscillator import START_NS, Crystal, Oscillator
from pps.sim.temperature import Ramp, Temperature, clouds, engine, fan
from pps.timemark import Second
from tests.pps.estimate import CALM, EVEN, HOUR, LIVELY, fix, quality, steady
from tests.pps.station import SECOND_NS, START_S, Station, figures


class Day(NamedTuple):
    """What a station goes through. silences: (from, to) in seconds, without pulses."""

    hours: int
    base_ns: float  # how late its interrupts are at least: 2 to 9 us by board, of which the estimator assumes 6 +- 4
    ramps: Sequence[Ramp] = ()
    crystal: Crystal | None = None
    loads: Sequence[tuple[float, float]] = ()
    silences: Sequence[tuple[float, float]] = ()


DAYS = {
    "an even half of a day": Day(12, 3_000),
    "a fan that comes and goes, an engine": Day(10, 3_500, fan(1, HOUR, 9 * HOUR) + engine(5 * HOUR)),
    "sun and clouds, heavy work for five hours": Day(
        10, 2_500, clouds(2, 2 * HOUR, 8 * HOUR), loads=[(3 * HOUR, 8 * HOUR)]
    ),
    "a crystal beside the fan, of 16 ppm for 8 K": Day(10, 8_000, fan(1, HOUR, 9 * HOUR, 8, 600), LIVELY),
    "silences of 5 s to 4 h, the engine within the longest": Day(
        14,
        8_500,
        engine(9 * HOUR, 25),
        silences=[
            (at, at + length)
            for at, length in (
                (1800, 5),
                (2000, 30),
                (3000, 120),
                (2 * HOUR, 900),
                (5 * HOUR, 3000),
                (8 * HOUR, 4 * HOUR),
            )
        ],
    ),
    "a silence of 3 h while the fan comes and goes": Day(
        12, 3_500, fan(3, HOUR, 12 * HOUR, 8), silences=[(6 * HOUR, 9 * HOUR)]
    ),
    "a silence of 3 h after an even morning, and all at once the engine": Day(
        10, 3_500, engine(6 * HOUR + 60, 20, 600), silences=[(6 * HOUR, 9 * HOUR)]
    ),
}


@pytest.mark.parametrize("name", DAYS)
def test_the_truth_is_inside_the_bound_and_the_bound_is_not_wide(name: str):
    day = DAYS[name]
    air = Temperature(ramps=day.ramps)
    station = Station(len(name), crystal=day.crystal, air=air, base_ns=day.base_ns, loads=day.loads)
    samples = station.run(day.hours * HOUR, day.silences)
    seen = figures(samples)
    print(f"\n{name}: {seen}")
    silent = [one for one in samples if any(begin + 60 < one.second < end for begin, end in day.silences)]
    if silent:
        print(f"  in the silences: {figures(silent)}")
    assert seen.covered >= 0.999
    assert seen.ratio <= 5
    assert station.estimator.surprises == 0


# States


def test_the_state_says_whose_word_the_time_is():
    station = Station(1, system_error_ns=70_000_000)
    machine, estimator = station.machine, station.estimator
    assert quality(station, 0.5) == TimeQuality()

    estimator.system(-70_000_000, 400_000_000, machine.clocks(START_NS).raw_ns)
    assert quality(station, 1).state == Lock.SYSTEM

    station.estimator.fix(fix(station, 1.0, 0.1), machine.clocks(START_NS + SECOND_NS * 11 // 10))
    assert quality(station, 1.2).state == Lock.COARSE
    assert quality(station, 1.2).jitter_ns is None

    station.pulse(2)
    assert quality(station, 2.3).state == Lock.SETTLING
    station.pulses(range(3, 12))
    assert quality(station, 11.3).state == Lock.LOCKED
    assert quality(station, 14.3).state == Lock.LOCKED  # two are missed
    assert quality(station, 14.7).state == Lock.HOLDOVER
    station.pulse(60)
    assert quality(station, 60.3).state == Lock.SETTLING
    station.pulses(range(61, 70))
    assert quality(station, 69.3).state == Lock.LOCKED


def test_each_figure_is_what_it_says():
    station = steady(2_000, system_error_ns=3_000_000)
    event = LeapEvent(START_S + 5_000, 1)
    pulse = station.edges.edge(START_NS + 2_002 * SECOND_NS)
    station.estimator.second(Second(pulse, START_S + 2_002, 20, 18, event))
    said = quality(station, 2_002.5)
    truth_ns = station.machine.system_offset_ns(START_NS + 20_025 * SECOND_NS // 10)
    assert said.offset_ns == pytest.approx(truth_ns, abs=1_500)
    assert said.uncertainty_ns is not None
    assert 4_000 < said.uncertainty_ns < 6_000
    assert said.error_ns == abs(said.offset_ns) + said.uncertainty_ns
    assert said.jitter_ns == pytest.approx(400, abs=150)
    frequency_ppb = station.oscillator.frequency_ppb(START_NS + 2_002 * SECOND_NS)
    assert said.frequency_ppb == pytest.approx(frequency_ppb, abs=said.skew_ppb)
    assert 1 < said.skew_ppb < 100
    assert said.age_s == pytest.approx(0.5, abs=1e-4)
    assert said.leap == event


def test_frequency_is_within_its_skew_of_the_truth_while_the_fan_comes_and_goes():
    station = Station(3, air=Temperature(ramps=fan(1, 600, 4 * HOUR)))
    inside = []
    for second in range(2, 4 * HOUR):
        station.pulse(second)
        if second > 100 and second % 10 == 0:
            said, now_ns = quality(station, second + 0.2), START_NS + second * SECOND_NS
            truth = (
                station.oscillator.raw_ns(now_ns + 8 * SECOND_NS) - station.oscillator.raw_ns(now_ns)
            ) / 8 - SECOND_NS
            inside.append(abs(said.frequency_ppb - truth) <= said.skew_ppb)
    assert sum(inside) / len(inside) >= 0.995


def test_a_step_of_the_system_clock_moves_the_offset_and_nothing_else():
    station = steady()
    before = quality(station, 601.5)
    station.machine.step(START_NS + 6_016 * SECOND_NS // 10, 500_000)
    after = quality(station, 601.7)
    assert after.offset_ns - before.offset_ns == pytest.approx(-500_000, abs=50_000)
    assert (after.state, after.jitter_ns) == (before.state, before.jitter_ns)
    assert after.uncertainty_ns == pytest.approx(before.uncertainty_ns, abs=200)


def test_a_leap_second_is_in_the_offset_from_its_first_moment_on():
    # 2016-12-31T23:59:60; the machine's clock, which nobody told, counts on as if there were none.
    leap_ns = 410_313_604 * SECOND_NS
    assert BUILT_IN.civil(leap_ns) == "2016-12-31T23:59:60.000Z"
    oscillator = Oscillator(CALM, EVEN, 1, its_ns=leap_ns - 100 * SECOND_NS)
    machine, estimator = Machine(oscillator), Estimator()
    edges = Edges(machine, Interrupts(1, base_ns=5_000), 1)
    offsets = {}
    for its_s in range(leap_ns // SECOND_NS - 98, leap_ns // SECOND_NS + 5):
        estimator.second(Second(edges.edge(its_s * SECOND_NS), its_s, 20, 17, None))
        after = its_s - leap_ns // SECOND_NS
        offsets[after] = estimator.quality(machine.clocks(its_s * SECOND_NS + SECOND_NS // 2)).offset_ns
    assert offsets[0] - offsets[-1] == pytest.approx(-SECOND_NS, abs=20_000)
    assert offsets[4] - offsets[0] == pytest.approx(0, abs=100_000)


# Work and memory


def test_its_memory_does_not_grow():
    station = steady(3 * HOUR)
    before = len(pickle.dumps(station.estimator))
    station.pulses(range(3 * HOUR + 2, 8 * HOUR))
    assert len(pickle.dumps(station.estimator)) < 1.1 * before < 40_000
