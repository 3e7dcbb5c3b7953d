"""Own ITS time: by pulses, a receiver, the system; and through a leap second, whichever it is."""

import time
from collections.abc import Iterator
from types import SimpleNamespace

import pytest

from board.time.leaps import BUILT_IN
from board.time.scales import EPOCH, GPS_LEAD, TAI_LEAD, Fix, LeapEvent, TimeMark
from firmware.clock.own_time import OwnTime

LEAP_S = 1_483_228_800 - EPOCH + 4  # ITS second of 2016-12-31T23:59:60
EVENT = LeapEvent(LEAP_S, 1)
WEEK_MS = 604_800_000
ESTIMATOR = SimpleNamespace(its_ms=lambda monotonic: round((monotonic - 1000.0 + LEAP_S) * 1000))


class System:
    """The clocks of a machine at a moment of ITS time; the system's repeats a leap second, as the kernel does."""

    def __init__(self, its_s: float) -> None:
        self.its_s = its_s
        self.tai_lead = 0

    @property
    def unix_s(self) -> float:
        return self.its_s + EPOCH - (4 if self.its_s < LEAP_S else 5)

    def monotonic(self) -> float:
        return self.its_s - LEAP_S + 1000.0

    def gettime(self, which: int) -> float:
        return self.unix_s + (self.tai_lead if which == time.CLOCK_TAI else 0)


@pytest.fixture
def system(monkeypatch: pytest.MonkeyPatch) -> Iterator[System]:
    system = System(LEAP_S - 5.0)
    monkeypatch.setattr("firmware.clock.own_time.time.time", lambda: system.unix_s)
    monkeypatch.setattr("firmware.clock.own_time.time.clock_gettime", system.gettime)
    return system


@pytest.fixture
def own(system: System) -> OwnTime:
    return OwnTime(system.monotonic)


def error_ms(own: OwnTime, system: System) -> int:
    its_ms = own.its_ms(system.monotonic())
    assert its_ms is not None
    return its_ms - round(system.its_s * 1000)


def steps(system: System, until_s: float = 5.0) -> Iterator[None]:
    """Every 10 ms of the seconds about the leap second."""
    for step in range(-500, round(until_s * 100)):
        system.its_s = LEAP_S + step / 100
        yield


def mark(system: System, its_s: int, **more: object) -> TimeMark:
    told = TimeMark(system.monotonic(), its_s + EPOCH - 4, 25, None, True, 17, its_s, EVENT)
    return told._replace(**more)


def fix(system: System) -> Fix:
    """Of this moment, as NAV-PVT has it."""
    gps_ms = round((system.its_s + GPS_LEAD) * 1000)
    return Fix(system.monotonic(), utc_ns=round(system.unix_s * 1e9), utc_accuracy_ns=20, tow_ms=gps_ms % WEEK_MS)


def test_pulses_tell_it_through_a_leap_second(own: OwnTime, system: System) -> None:
    own.estimator = ESTIMATOR
    assert {error_ms(own, system) for _ in steps(system)} == {0}


def test_a_receivers_messages_tell_it_through_a_leap_second(own: OwnTime, system: System) -> None:
    own.time_mark(mark(system, LEAP_S - 5))
    errors = set()
    for _ in steps(system):
        own.fix(fix(system))
        errors.add(error_ms(own, system))
    assert errors == {0}


def test_a_receiver_that_is_silent_is_aged_through_a_leap_second(own: OwnTime, system: System) -> None:
    own.fix(fix(system))
    assert {error_ms(own, system) for _ in steps(system)} == {0}


def test_the_kernels_tai_tells_it_through_a_leap_second(own: OwnTime, system: System) -> None:
    own.leaps = BUILT_IN
    errors = set()
    for _ in steps(system):
        system.tai_lead = TAI_LEAD - EPOCH + (4 if system.its_s < LEAP_S else 5)
        errors.add(error_ms(own, system))
    assert errors == {0}


def test_the_systems_clock_alone_is_wrong_in_the_leap_second_and_at_no_other_time(own: OwnTime, system: System) -> None:
    own.time_mark(mark(system, LEAP_S - 5))
    wrong = [system.its_s for _ in steps(system) if error_ms(own, system)]
    assert (min(wrong), round(max(wrong), 2)) == (LEAP_S, LEAP_S + 0.99)


@pytest.mark.parametrize("of_kernel", [0, 3, 6])
def test_a_kernel_that_counts_otherwise_than_the_table_is_not_asked(
    own: OwnTime, system: System, of_kernel: int
) -> None:
    own.leaps = BUILT_IN
    system.its_s = LEAP_S - 5.0
    system.tai_lead = of_kernel and TAI_LEAD - EPOCH + of_kernel
    assert error_ms(own, system) == 0


def test_leap_seconds_of_a_list_are_those_of_the_systems_clock(own: OwnTime, system: System) -> None:
    own.leaps = BUILT_IN.told(19, None, LEAP_S + 86_400)
    system.its_s = LEAP_S + 200 * 86_400.0
    assert error_ms(own, system) == 1000


def test_leap_seconds_of_a_mark_before_it_is_locked_are_not_believed(own: OwnTime, system: System) -> None:
    own.time_mark(mark(system, LEAP_S - 6, leap_seconds=25, is_locked=False))
    assert error_ms(own, system) == 0
    own.fix(fix(system))
    assert error_ms(own, system) == 0


def test_a_message_is_no_better_than_a_system_that_is_known_well(own: OwnTime, system: System) -> None:
    told = fix(system)
    system.its_s += 0.14
    own.fix(told._replace(monotonic=system.monotonic()))
    assert error_ms(own, system) == -140
    own.is_system_good = True
    assert error_ms(own, system) == 0


@pytest.mark.parametrize("late_ms", [0, 30, 140, 900])
def test_a_position_has_the_time_of_its_epoch_and_not_of_its_coming(own: OwnTime, system: System, late_ms: int) -> None:
    own.estimator = ESTIMATOR
    own.time_mark(mark(system, LEAP_S - 5))
    epoch_ms = round(system.its_s * 1000)
    told = fix(system)
    system.its_s += late_ms / 1000
    assert own.of_fix(told._replace(monotonic=system.monotonic())) == epoch_ms


@pytest.mark.parametrize("wrong_s", [-2, -1, 1, 2, 19 * 604_800])
def test_a_receiver_that_says_another_second_than_pulses_is_not_believed(
    own: OwnTime, system: System, wrong_s: int
) -> None:
    own.estimator = ESTIMATOR
    told = fix(system)
    assert told.utc_ns is not None
    wrong = told._replace(utc_ns=told.utc_ns + wrong_s * 10**9, tow_ms=None)
    assert own.of_fix(wrong) == round(system.its_s * 1000)


def test_a_week_that_begins_between_mark_and_epoch_is_the_same_time(own: OwnTime, system: System) -> None:
    system.its_s = float(-GPS_LEAD % 604_800 + 604_800 * 700)  # begins a week of GPS
    own.time_mark(mark(system, round(system.its_s) - 1))
    own.fix(fix(system))
    assert error_ms(own, system) == 0


def test_a_time_of_week_that_is_far_from_the_mark_is_not_used(own: OwnTime, system: System) -> None:
    own.time_mark(mark(system, LEAP_S - 5))
    told = fix(system)
    assert told.tow_ms is not None
    own.fix(told._replace(tow_ms=(told.tow_ms + 60_000) % WEEK_MS))
    assert error_ms(own, system) == 0  # by UTC
