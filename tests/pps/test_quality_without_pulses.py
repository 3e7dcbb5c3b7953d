"""Estimate in holdover, from messages, and from the system's word."""

from dataclasses import replace
from random import Random

import pytest

from board.time.leaps import BUILT_IN
from board.time.scales import Fix, Lock, TimeQuality
from pps.messages import MOST_NS
from pps.sim.oscillator import START_NS, Crystal
from pps.sim.temperature import Ramp, Temperature, engine
from tests.pps.estimate import CALM, HOUR, LIVELY, fix, quality, steady
from tests.pps.station import SECOND_NS, Station, grows

# Holdover


def test_the_bound_grows_from_second_to_second_while_no_pulse_comes():
    station = steady(3 * HOUR)
    away = [station.sample(3 * HOUR + 2 + age) for age in (0.5, 1, 2, 4, 10, 60, 300, 1200, 3600, 7200, 20000)]
    assert grows(away)
    assert away[5].uncertainty_ns < 150_000  # a minute
    assert away[7].uncertainty_ns < 20_000_000  # 20 minutes: 20 ms is what ITS applications ask for


def test_what_has_been_seen_of_the_oscillator_is_in_the_bound():
    calm, lively = steady(2 * HOUR), Station(1, crystal=Crystal(flicker_ppb=500, walk_ppb=3), base_ns=5_000)
    lively.run(2 * HOUR)
    away = 2 * HOUR + 602
    assert lively.sample(away).uncertainty_ns > 1.5 * calm.sample(away).uncertainty_ns


def test_an_oscillator_that_surprises_is_told_of_and_trusted_less():
    # A jump of 40 ppm in the silence: what nothing had shown, and no crystal does that is sound.
    broken = Temperature(diurnal_k=0, ramps=[Ramp(5_000, 100)])
    station = Station(1, crystal=Crystal(linear_ppb=400, cubic_ppb=0), air=broken, base_ns=5_000)
    station.run(4_000)
    before_ns = station.sample(4_001 + 1_024).uncertainty_ns
    station.run(3_000, begin_s=6_000)
    assert station.estimator.surprises == 1
    assert station.estimator.model.surprise_ns > 1_000_000
    after = station.sample(9_000 + 1_024)
    assert after.uncertainty_ns > 3 * before_ns
    assert abs(station.sample(8_999.9).error_ns) < 3_000


def test_a_silence_of_some_seconds_changes_nothing():
    station = steady()
    station.pulses(range(609, 620))
    assert quality(station, 619.5).state == Lock.LOCKED
    assert station.sample(619.5).uncertainty_ns < 6_000


def test_other_seconds_of_a_new_series_are_believed_at_once():
    station = steady()
    station.pulse(602, label_s=603, series=2)  # all before were labelled one second too early
    known = station.estimator.estimate(station.oscillator.raw_ns(START_NS + 602 * SECOND_NS + 300_000_000))
    assert abs(known[0] - START_NS - 603 * SECOND_NS - 300_000_000) < known[1]
    assert quality(station, 602.3).state == Lock.SETTLING
    assert station.estimator.surprises == 0


def test_what_was_foretold_of_other_seconds_is_no_error_of_the_oscillator():
    warmer = Temperature(diurnal_k=0, ramps=[Ramp(500, 10)])
    station, other = (Station(1, crystal=CALM, air=warmer, base_ns=5_000) for _ in range(2))
    station.pulses(range(2, 3_002))
    other.pulses(range(2, 6_000))
    for second in range(3_002, 6_000):
        station.pulse(second, label_s=second + 1, series=2)
    assert station.sample(6_128).uncertainty_ns < 1.2 * other.sample(6_128).uncertainty_ns


def test_pulses_before_and_after_a_silence_make_no_line_together():
    station = Station(1, crystal=LIVELY, air=Temperature(ramps=engine(100, 25, 600)), base_ns=5_000)
    station.pulses(range(2, 6))
    station.pulses(range(1_500, 1_508))
    sample = station.sample(1_507.5)
    assert abs(sample.error_ns) < sample.uncertainty_ns < 20_000


def test_a_new_series_of_the_same_seconds_goes_on():
    station = steady()
    station.pulse(602, series=2)
    assert quality(station, 602.3).state == Lock.LOCKED


# Messages, and the system's word


def test_messages_alone_bound_the_time_however_late_they_are():
    station, random = Station(1, system_error_ns=5 * SECOND_NS), Random(1)
    for epoch in range(1, 300):
        late_s = random.uniform(0.02, 0.3)
        now_ns = START_NS + round((epoch + late_s) * SECOND_NS)
        station.estimator.fix(fix(station, epoch, late_s), station.machine.clocks(now_ns))
        said = station.estimator.quality(station.machine.clocks(now_ns + 50_000_000))
        assert said.state == Lock.COARSE
        assert (
            abs(said.offset_ns - station.machine.system_offset_ns(now_ns))
            <= said.uncertainty_ns
            <= MOST_NS // 2 + 100_000
        )


def test_a_message_later_than_messages_are_moves_no_bound_once_another_was_in_time():
    station = Station(1)
    for epoch, late_s in ((1, 0.05), (2, 0.9)):
        now_ns = START_NS + round((epoch + late_s) * SECOND_NS)
        station.estimator.fix(fix(station, epoch, late_s), station.machine.clocks(now_ns))
    said = station.estimator.quality(station.machine.clocks(now_ns))
    assert abs(said.offset_ns - station.machine.system_offset_ns(now_ns)) <= said.uncertainty_ns


def told(station: Station, epoch: float, late_s: float, off_s: int = 0) -> Fix:
    """Give the estimator the message of an epoch, so late."""
    said = fix(station, epoch, late_s)
    assert said.utc_ns is not None
    said = said._replace(utc_ns=said.utc_ns + off_s * SECOND_NS)
    station.estimator.fix(said, station.machine.clocks(START_NS + round((epoch + late_s) * SECOND_NS)))
    return said


def is_inside(station: Station, second: float) -> bool:
    said = quality(station, second)
    truth_ns = station.machine.system_offset_ns(START_NS + round(second * SECOND_NS))
    return abs(said.offset_ns - truth_ns) <= said.uncertainty_ns < MOST_NS


@pytest.mark.parametrize("off_s", [1, -1, 2, 3600])
def test_epochs_of_other_seconds_move_no_bound_until_they_have_lasted(off_s: int):
    station, random = Station(1), Random(1)
    for epoch in range(1, 1_000):
        told(station, epoch, random.uniform(0.03, 0.3))
    for epoch in range(1_000, 1_750):
        told(station, epoch, random.uniform(0.03, 0.3), off_s)
        assert is_inside(station, epoch + 0.4)
    for epoch in range(1_750, 2_600):
        told(station, epoch, random.uniform(0.03, 0.3), off_s)
    assert not is_inside(station, 2_600)  # it says so for good


def test_a_first_epoch_that_was_wrong_is_outvoted_by_the_next_two():
    station = Station(1)
    for epoch, off_s in ((1, 1), (2, 0), (3, 0)):
        told(station, epoch, 0.1, off_s)
    assert is_inside(station, 3.2)


def test_a_message_may_be_taken_long_after_it_came():
    station = Station(1)
    said = fix(station, 5, 0.1)
    station.estimator.fix(said, station.machine.clocks(START_NS + 7 * SECOND_NS))
    assert is_inside(station, 7.1)


def test_other_leap_seconds_make_other_seconds_of_messages_at_once():
    station = Station(1)
    early = replace(BUILT_IN, rows=BUILT_IN.rows[:-1])
    station.estimator.leaps = early
    for epoch in range(1, 30):
        told(station, epoch, 0.1)
    assert is_inside(station, 29.5)
    station.estimator.leaps = BUILT_IN
    assert is_inside(station, 29.5)
    told(station, 30, 0.1)
    assert is_inside(station, 30.5)


def test_a_message_without_a_time_says_nothing():
    station = Station(1)
    station.estimator.fix(Fix(1.0), station.machine.clocks(START_NS + SECOND_NS))
    assert quality(station, 1.5) == TimeQuality()


def test_messages_are_better_than_an_oscillator_that_has_been_alone_for_a_day():
    station = steady()
    later = 30 * HOUR
    station.estimator.fix(fix(station, later, 0.1), station.machine.clocks(START_NS + later * SECOND_NS + 100_000_000))
    assert quality(station, 700).state == Lock.HOLDOVER
    assert quality(station, later + 0.2).state == Lock.COARSE


def test_pulses_are_believed_before_a_system_that_says_it_is_better():
    station = steady()
    for at_s in (601.3, 640.0):
        station.estimator.system(2_000, 300, station.machine.clocks(START_NS + round(at_s * SECOND_NS)).raw_ns)
        assert quality(station, at_s).state == (Lock.LOCKED if at_s < 605 else Lock.SYSTEM)


def test_the_system_is_believed_less_the_longer_it_says_nothing():
    station = Station(1)
    station.estimator.system(2_000, 5_000_000, station.machine.clocks(START_NS).raw_ns)
    soon, late = quality(station, 1), quality(station, 1_000)
    assert (soon.state, soon.offset_ns) == (Lock.SYSTEM, 2_000)
    assert late.uncertainty_ns - soon.uncertainty_ns == pytest.approx(999 * 15_000, rel=0.01)
