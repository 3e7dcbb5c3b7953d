"""Simulated pulses: at whole seconds of true time, with chosen errors."""

import random
from itertools import pairwise

import pytest

from pps.pulse import Clocks
from pps.simulated import SECOND_NS, Simulated
from tests.pps.above import Told

SYSTEM_NS = 1_700_000_000 * SECOND_NS  # of the system's clock where the loop's is 0
FAST_PPM = 40  # the oscillator runs so fast


class Bench:
    def __init__(self, loop, **options):
        self.loop = loop
        self.told = Told()
        self.step_ns = 0
        self.simulated = Simulated(loop, self.told, clocks=self.clocks, **options)
        self.simulated.start()

    def clocks(self):
        now_ns = round(self.loop.now * 1e9)
        raw_ns = now_ns + now_ns * FAST_PPM // 10**6
        return Clocks(SYSTEM_NS + self.step_ns + now_ns, raw_ns, self.loop.now)

    @property
    def phases_ns(self):
        """How long after the whole second of the system's clock the pulses were."""
        return [pulse.system_ns % SECOND_NS for pulse in self.told.pulses]

    @property
    def intervals_ns(self):
        stamps = [pulse.raw_ns for pulse in self.told.pulses]
        return [later - earlier for earlier, later in pairwise(stamps)]


@pytest.fixture
def bench(loop):
    loop.now = 1000.3
    return Bench(loop)


def test_pulses_are_at_whole_seconds_of_the_systems_clock_where_nobody_says_another_time(bench):
    bench.loop.run_for(100.0)
    assert bench.phases_ns == [0] * 100
    assert [pulse.sequence for pulse in bench.told.pulses] == list(range(1, 101))
    assert bench.told.gaps == []


def test_each_pulse_is_stamped_by_each_clock(bench):
    bench.loop.run_for(10.0)
    assert [pulse.monotonic for pulse in bench.told.pulses] == pytest.approx([1001.0 + count for count in range(10)])
    assert set(bench.intervals_ns) == {SECOND_NS + FAST_PPM * 1000}


def test_pulses_follow_the_truth_and_not_the_systems_clock(loop):
    # The truth is 250 ms ahead of a system's clock that loses 20 ppm against it.
    bench = Bench(loop, truth=lambda now: now.system_ns + 250_000_000 + round(now.monotonic * 20_000))
    bench.loop.run_for(50.0)
    late = [750_000_000 - round(pulse.monotonic * 20_000) for pulse in bench.told.pulses]
    assert len(late) == 50
    assert bench.phases_ns == pytest.approx(late, abs=2)


def test_a_timer_that_is_late_makes_no_pulse_late(loop):
    bench = Bench(loop)
    for _ in range(5):
        loop.now += 1.003  # held up by something else
        loop.turn()
    assert bench.phases_ns == [0] * 5


def test_a_timer_that_is_early_makes_no_pulse_early(loop):
    bench = Bench(loop, truth=lambda now: now.system_ns - (500 if loop.now < 1001.0000002 else 0))
    bench.loop.run_for(3.0)
    assert [pulse.sequence for pulse in bench.told.pulses] == [1, 2, 3]
    assert bench.phases_ns == [0, 0, 0]


def test_while_nobody_knows_the_truth_there_are_no_pulses(loop):
    bench = Bench(loop, truth=lambda now: now.system_ns if loop.now > 1050.0 else None)
    bench.loop.run_for(50.0)
    assert bench.told.all == []
    bench.loop.run_for(5.0)
    assert 4 <= len(bench.told.pulses) <= 5
    assert set(bench.phases_ns) == {0}


def test_a_truth_that_stands_still_keeps_nobody_busy(loop):
    asked = []
    bench = Bench(loop, truth=lambda now: asked.append(now) or -1)
    bench.loop.run_for(10.0)
    assert bench.told.all == []
    assert len(asked) <= 10_000


def test_stamps_have_the_latency_of_the_model(loop):
    chance = random.Random(6)
    latencies_ns = [chance.randrange(3_000, 90_000) for _ in range(50)]
    drawn = iter(latencies_ns)
    bench = Bench(loop, latency_ns=lambda: next(drawn))
    bench.loop.run_for(45.5)
    assert bench.phases_ns == latencies_ns[:45]


def test_silence_is_no_pulses_and_no_gap_in_their_sequence(bench):
    bench.loop.run_for(3.0)
    bench.simulated.is_silent = True
    bench.loop.run_for(10.0)
    assert len(bench.told.pulses) == 3
    bench.simulated.is_silent = False
    bench.loop.run_for(2.0)
    assert [pulse.sequence for pulse in bench.told.pulses] == [1, 2, 3, 4, 5]
    assert bench.told.gaps == []


@pytest.mark.parametrize("late_ns", [400, 5_000_000, 700_000_000])
def test_late_pulses_are_late_by_what_is_told_and_never_two_in_a_second(bench, late_ns):
    bench.loop.run_for(3.0)
    bench.simulated.late_ns = late_ns
    bench.loop.run_for(10.0)
    assert set(bench.phases_ns[5:]) == {late_ns}
    assert min(bench.intervals_ns) >= SECOND_NS // 2


def test_doubled_pulses_come_twice_and_are_counted_as_extra(bench):
    bench.simulated.double_ns = 20_000_000
    bench.loop.run_for(3.0)
    assert bench.phases_ns == [0, 20_000_000] * 3
    assert bench.simulated.tally.extra == 3


def test_a_step_of_the_systems_clock_moves_no_pulse_where_the_truth_is_another(loop):
    bench = Bench(loop, truth=lambda now: round(now.monotonic * 1e9))
    bench.loop.run_for(3.0)
    bench.step_ns = 123_456_789
    bench.loop.run_for(3.0)
    assert bench.phases_ns == [0] * 3 + [123_456_789] * 3
    assert set(bench.intervals_ns) == {SECOND_NS + FAST_PPM * 1000}


def test_nothing_is_told_after_the_end_until_it_is_started_again(bench):
    bench.simulated.double_ns = 20_000_000
    bench.told.then = bench.simulated.stop
    bench.loop.run_for(10.0)
    assert len(bench.told.all) == 1
    bench.simulated.start()
    bench.simulated.start()
    bench.loop.run_for(1.0)
    assert [pulse.sequence for pulse in bench.told.all] == [1, 2]
    assert bench.told.gaps == []
