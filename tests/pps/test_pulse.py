"""Clocks that are read together, and pulses that are counted."""

import itertools

import pytest

from pps import pulse as module
from pps.pulse import EXTRA_NS, MORE_READINGS, TIGHT_NS, Clocks, Pulse, Tally, pulse_at, read_clocks
from tests.pps.above import Told

SECOND = 10**9


@pytest.fixture
def told():
    return Told()


@pytest.fixture
def tally(told):
    tally = Tally(told)
    tally.begin(100)
    return tally


def pulse(sequence, raw_ns=0):
    return Pulse(sequence, 0, raw_ns, 0.0)


class SlowTime:
    """The module time of a machine on which something comes between two readings now and then."""

    CLOCK_REALTIME, CLOCK_MONOTONIC_RAW = "system", "raw"

    def __init__(self, delays_ns):
        self.now_ns = 0
        self.delays_ns = itertools.chain(delays_ns, itertools.repeat(100))
        self.readings = 0

    def clock_gettime_ns(self, which):
        self.readings += which == "raw"
        self.now_ns += next(self.delays_ns)
        return self.now_ns + (7 * SECOND if which == "system" else 0)

    def monotonic(self):
        return self.now_ns / 1e9


@pytest.mark.parametrize("at", [1, 2])
def test_clocks_between_which_something_came_are_read_again(monkeypatch, at):
    slow = SlowTime([100] * at + [3_000_000])
    monkeypatch.setattr(module, "time", slow)
    now = read_clocks()
    assert abs(now.system_ns - 7 * SECOND - now.raw_ns) <= 100
    assert slow.readings == 4


def test_of_clocks_that_are_never_read_quickly_the_best_reading_is_had(monkeypatch):
    widths_ns = [9 * TIGHT_NS, 3 * TIGHT_NS, 5 * TIGHT_NS, 7 * TIGHT_NS]
    slow = SlowTime([delay for width in widths_ns for delay in (0, width // 2, width // 2)])
    monkeypatch.setattr(module, "time", slow)
    now = read_clocks()
    assert now.raw_ns == (9 + 3 / 2) * TIGHT_NS
    assert slow.readings == 2 * (MORE_READINGS + 1)


def test_the_clocks_of_this_machine_go_on():
    first, second = read_clocks(), read_clocks()
    assert second.raw_ns > first.raw_ns
    assert second.monotonic > first.monotonic


def test_a_pulse_is_as_long_ago_by_each_clock():
    now = Clocks(system_ns=5_000_000_123, raw_ns=900_000_456, monotonic=17.25)
    assert pulse_at(3, 5_000_000_000, now) == Pulse(3, 5_000_000_000, 900_000_333, 17.25 - 123e-9)


def test_pulses_in_sequence_are_told_one_by_one(tally, told):
    pulses = [pulse(100 + count, count * SECOND) for count in (1, 2, 3)]
    for each in pulses:
        tally.take(each)
    assert told.all == pulses
    assert (tally.taken, tally.missed, tally.extra) == (3, 0, 0)


def test_pulses_that_are_missing_are_told_before_the_next(tally, told):
    tally.take(pulse(104))
    tally.take(pulse(106, 2 * SECOND))
    assert told.all == [3, pulse(104), 1, pulse(106, 2 * SECOND)]
    assert tally.missed == 4


@pytest.mark.parametrize(("last", "first", "missed"), [
    (2**32 - 1, 0, []), (2**32 - 2, 1, [2]), (2**32 - 1, 3, [3]), (0, 1, []),
])  # fmt: skip
def test_a_sequence_wraps_at_two_to_the_32(told, last, first, missed):
    tally = Tally(told)
    tally.begin(last)
    tally.take(pulse(first))
    assert told.gaps == missed


def test_a_pulse_too_soon_is_told_and_counted_as_extra(tally, told):
    for sequence, raw_ns in enumerate([0, 20_000_000, SECOND, SECOND + EXTRA_NS], start=101):
        tally.take(pulse(sequence, raw_ns))
    assert tally.extra == 1
    assert len(told.pulses) == 4


def test_a_source_that_is_opened_again_begins_with_another_sequence_and_goes_on_counting(tally, told):
    tally.take(pulse(101))
    tally.end()
    tally.begin(7)
    tally.take(pulse(8, 1))
    assert (told.gaps, tally.taken, tally.extra) == ([], 2, 0)


def test_what_ends_a_source_meanwhile_is_the_last_that_it_tells(tally, told):
    told.then = tally.end
    tally.take(pulse(104))
    tally.take(pulse(105))
    assert told.all == [3]
