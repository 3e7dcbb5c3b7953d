"""Own ITS time: from pulses, receiver messages or the system clock."""

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple, Protocol

from board.time.scales import EPOCH, GPS_LEAD, ITS_END, TAI_LEAD, Fix, TimeMark, leap_seconds

if TYPE_CHECKING:
    from board.time.leaps import Leaps

# Seconds for which the last message of a receiver is extrapolated. The monotonic clock of a board has an error of up to
# 50 ppm, which is 0.2 s after an hour. After that the system clock is better, if it is set.
HOLDOVER_S = 3600.0
WEEK_MS = 604_800_000  # length of a GPS week, after which the time of week restarts at 0
# Largest delay in ms of a receiver's message after its epoch. The slowest receiver, at 38,400 baud, needs 0.5 s.
LATEST_MS = 900
SLACK_MS = 50  # largest difference in ms between the time marks and the epochs of one receiver


class TimeReading(NamedTuple):
    """ITS time in ms, and the time of the monotonic clock in seconds at which it was valid."""

    its_ms: float
    monotonic: float

    def at(self, monotonic: float) -> int:
        """Return the ITS time in ms at another time of the monotonic clock, by extrapolation."""
        return round(self.its_ms + (monotonic - self.monotonic) * 1000)


class TimeEstimator(Protocol):
    """Estimator of time from pulses (firmware.clock.pulsed_time.PulsedTime)."""

    def its_ms(self, monotonic: float) -> int | None:
        """Return the ITS time in ms at a time of the monotonic clock; None if unknown."""


class OwnTime:
    """Own ITS time, combined from pulses, receivers and the system clock.

    If a receiver reports no accuracy of its UTC, its firmware may guess the leap seconds. Its time is used only while
    the system clock is not set. A receiver that reports its time of week needs no leap seconds for ITS time, so its
    time is also correct in a leap second.

    clock           returns the time of the monotonic clock in seconds.
    estimator       estimator of time from pulses; None without pulses.
    leaps           leap-second table; None until it was read, while the built-in table is used.
    is_system_good  True if the system clock is more accurate than messages of a receiver.
    is_system_set   returns True if the system clock was set since boot.
    """

    def __init__(self, clock: Callable[[], float], is_system_set: Callable[[], bool] = lambda: True) -> None:
        self.estimator: TimeEstimator | None = None
        self.leaps: Leaps | None = None
        self.is_system_good = False
        self.is_system_set = is_system_set
        self._clock = clock
        self._sure: TimeReading | None = None
        self._unsure: TimeReading | None = None
        self._second: TimeReading | None = None  # the last announced pulse
        self._placed: tuple[Fix, int] | None = None  # last fix and the ITS time in ms of its epoch

    def fix(self, fix: Fix) -> None:
        """Take the time of a receiver's epoch, even if it has no position."""
        told = self.told(fix)
        if told is None:
            return
        if fix.utc_accuracy_ns is None:
            self._unsure = told
        else:
            self._sure = told

    def time_mark(self, mark: TimeMark) -> None:
        """Take the ITS second that a receiver announces for the next pulse. It needs no leap seconds."""
        if mark.its_s is not None and mark.is_locked:
            self._second = TimeReading(mark.its_s * 1000, mark.monotonic)

    def its_ms(self, monotonic: float) -> int | None:
        """Return the ITS time in ms at a time of the monotonic clock; None if unknown."""
        estimated = None if self.estimator is None else self.estimator.its_ms(monotonic)
        if estimated is not None:
            return estimated
        now = self._clock()
        is_fresh = self._sure is not None and now - self._sure.monotonic <= HOLDOVER_S
        if self._sure is not None and is_fresh and not self.is_system_good:
            return self._sure.at(monotonic)
        system_s = time.time() - (now - monotonic)
        if EPOCH <= system_s < ITS_END and self.is_system_set():
            return round(self._its_s(system_s) * 1000)
        known = self._sure or self._unsure
        return None if known is None else known.at(monotonic)

    def of_fix(self, fix: Fix) -> int | None:
        """Return the ITS time in ms of a fix's epoch; None if unknown.

        This is the receiver's time. If it contradicts the estimate from pulses, the estimate is returned instead.
        """
        if self._placed is not None and self._placed[0] is fix:  # cached, because this is called for each sent packet
            return self._placed[1]
        estimated = None if self.estimator is None else self.estimator.its_ms(fix.monotonic)
        if estimated is None:
            return self.its_ms(fix.monotonic)
        told = self.told(fix)
        is_agreed = told is not None and -SLACK_MS <= estimated - told.its_ms <= LATEST_MS
        self._placed = fix, round(told.its_ms) if told is not None and is_agreed else estimated
        return self._placed[1]

    def told(self, fix: Fix) -> TimeReading | None:
        """Return the ITS time that a receiver reports for an epoch, with the monotonic time of the fix.

        Return None if the receiver reports no time or an impossible one.
        """
        if fix.utc_ns is None or not EPOCH <= fix.utc_ns / 1e9 < ITS_END:
            return None
        return self._by_week(fix) or TimeReading(self._its_ns(fix.utc_ns) / 1e6, fix.monotonic)

    def _by_week(self, fix: Fix) -> TimeReading | None:
        """Return the ITS time from the fix's time of week, and the week of the last time mark.

        Return None if the fix has no time of week, or if the last time mark is missing or contradicts it.
        """
        if fix.tow_ms is None or self._second is None:
            return None
        near_ms = self._second.at(fix.monotonic) + GPS_LEAD * 1000
        ahead_ms = (fix.tow_ms - near_ms + WEEK_MS // 2) % WEEK_MS - WEEK_MS // 2
        is_agreed = abs(ahead_ms) <= 2000  # a mark is of the next second, an epoch is past
        return TimeReading(near_ms + ahead_ms - GPS_LEAD * 1000, fix.monotonic) if is_agreed else None

    def _its_ns(self, unix_ns: int) -> int:
        if self.leaps is None:
            return unix_ns + (leap_seconds(unix_ns / 1e9) - EPOCH) * 10**9
        return self.leaps.its_ns(unix_ns)

    def _its_s(self, system_s: float) -> float:
        """Convert a time of the system clock in Unix seconds to ITS time in seconds.

        A Unix time in a leap second is ambiguous. Then CLOCK_TAI of the kernel decides, if it agrees with the table.
        """
        system_ns = round(system_s * 1e9)
        if self.leaps is not None:
            lead_s = round(time.clock_gettime(time.CLOCK_TAI) - time.clock_gettime(time.CLOCK_REALTIME))
            by_kernel_ns = system_ns + (lead_s - TAI_LEAD) * 10**9
            if self.leaps.unix_ns(by_kernel_ns) == system_ns:
                return by_kernel_ns / 1e9
        return self._its_ns(system_ns) / 1e9
