"""What time it is for the station: by pulses, else a receiver's time aged by the monotonic clock, else the system's."""

import time
from collections.abc import Callable
from typing import NamedTuple

from board.time import EPOCH, GPS_LEAD, GPS_LEAPS, TAI_LEAD, Fix, LeapEvent, TimeMark, its_time_ms, leap_seconds

# The monotonic clock of a board is wrong by 50 ppm: 0.2 s after an hour. Then the system's clock is the better one,
# where it is set at all.
HOLDOVER_S = 3600.0
END = 2**42 // 1000 + EPOCH - 100  # ITS time has no number for what is later, in 2143
WEEK_MS = 604_800_000  # after which a time of week begins again
# A receiver's message of an epoch comes this much after it, ms; the slowest at 38,400 baud in 0.5 s.
LATEST_MS = 900
SLACK_MS = 50  # between what a mark and an epoch of one receiver say of the same moment


class Told(NamedTuple):
    """ITS time of a moment of the monotonic clock."""

    its_ms: float
    monotonic: float

    def at(self, monotonic: float) -> int:
        """ITS time of another moment: clocks of this machine go on."""
        return round(self.its_ms + (monotonic - self.monotonic) * 1000)


class OwnTime:
    """Takes what receivers say of time.

    A receiver that does not say how exact its time is may count leap seconds as its firmware guesses them: such a
    time stands in for a clock that is not set, and for none that is. One that says its time of week needs no leap
    seconds for ITS time, and has a number for a leap second itself.

    by_pulses  ITS time of a moment of the monotonic clock in ms; None while pulses do not tell it well enough.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self.by_pulses: Callable[[float], int | None] = lambda monotonic: None
        self._clock = clock
        self._sure: Told | None = None
        self._unsure: Told | None = None
        self._second: Told | None = None  # of the last pulse that was announced
        self._leap_seconds: int | None = None
        self._leap_event: LeapEvent | None = None
        self._placed: tuple[Fix, int] | None = None  # the last epoch whose time was told by pulses as well

    def fix(self, fix: Fix) -> None:
        """Note the time of an epoch, whatever it says of the place."""
        told = self._told(fix)
        if told is None:
            return
        if fix.utc_accuracy_ns is None:
            self._unsure = told
        else:
            self._sure = told

    def time_mark(self, mark: TimeMark) -> None:
        """Note the leap seconds that satellites tell: they hold until others are told."""
        if mark.leap_seconds is not None:
            self._leap_seconds = mark.leap_seconds - GPS_LEAPS
            self._leap_event = mark.leap_event
        if mark.its_s is not None:
            self._second = Told(mark.its_s * 1000, mark.monotonic)

    def its_ms(self, monotonic: float) -> int | None:
        """ITS time of a moment of the monotonic clock; None where nobody knows the time."""
        pulsed = self.by_pulses(monotonic)
        if pulsed is not None:
            return pulsed
        now = self._clock()
        if self._sure is not None and now - self._sure.monotonic <= HOLDOVER_S:
            return self._sure.at(monotonic)
        system_s = time.time() - (now - monotonic)
        if EPOCH <= system_s < END:
            return its_time_ms(system_s, self._counted(system_s))
        known = self._sure or self._unsure
        return None if known is None else known.at(monotonic)

    def of_fix(self, fix: Fix) -> int | None:
        """ITS time of the epoch of a fix: its receiver knows that best, but for a second that pulses say is wrong."""
        if self._placed is not None and self._placed[0] is fix:  # it is asked for with each packet that leaves
            return self._placed[1]
        pulsed = self.by_pulses(fix.monotonic)
        if pulsed is None:
            return self.its_ms(fix.monotonic)
        told = self._told(fix)
        is_agreed = told is not None and -SLACK_MS <= pulsed - told.its_ms <= LATEST_MS
        self._placed = fix, round(told.its_ms) if told is not None and is_agreed else pulsed
        return self._placed[1]

    def _told(self, fix: Fix) -> Told | None:
        if fix.utc_ns is None or not EPOCH <= fix.utc_ns / 1e9 < END:
            return None
        by_week = self._by_week(fix)
        if by_week is not None:
            return by_week
        utc_s = fix.utc_ns / 1e9
        counted = leap_seconds(utc_s) if self._leap_seconds is None else self._leap_seconds
        return Told((utc_s - EPOCH + counted) * 1000, fix.monotonic)

    def _by_week(self, fix: Fix) -> Told | None:
        """By its time of week and the week of the last mark; None where that has none, or says something else."""
        if fix.tow_ms is None or self._second is None:
            return None
        near_ms = self._second.at(fix.monotonic) + GPS_LEAD * 1000
        ahead_ms = (fix.tow_ms - near_ms + WEEK_MS // 2) % WEEK_MS - WEEK_MS // 2
        is_agreed = abs(ahead_ms) <= 2000  # a mark is of the second to come, and an epoch of one that was
        return Told(near_ms + ahead_ms - GPS_LEAD * 1000, fix.monotonic) if is_agreed else None

    def _counted(self, system_s: float) -> int:
        """Leap seconds at a moment by the system's clock: as satellites have told, as the kernel has been told, else
        as they are known to this program.
        """
        if self._leap_seconds is None:
            by_kernel = round(time.clock_gettime(time.CLOCK_TAI) - time.clock_gettime(time.CLOCK_REALTIME))
            return by_kernel - (TAI_LEAD - EPOCH) if by_kernel >= TAI_LEAD - EPOCH else leap_seconds(system_s)
        event = self._leap_event
        is_over = event is not None and system_s - EPOCH + self._leap_seconds >= event.its_s
        return self._leap_seconds + (event.change if event is not None and is_over else 0)
