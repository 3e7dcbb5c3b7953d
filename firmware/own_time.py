"""What time it is for the station: by the estimate, else by a receiver's messages, else by the system's clock."""

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from board.time import EPOCH, GPS_LEAD, ITS_END, TAI_LEAD, Fix, TimeMark, leap_seconds

if TYPE_CHECKING:
    from board.leaps import Leaps

# The monotonic clock of a board is wrong by 50 ppm: 0.2 s after an hour. Then the system's clock is the better one,
# where it is set at all.
HOLDOVER_S = 3600.0
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

    estimated  ITS time of a moment of the monotonic clock in ms, by the estimate of which the station states how good
               it is; None where there is none.
    leaps      by which Unix time is understood; None: not read yet, what is built in.
    is_system_good  the system's clock is known better than messages can be.
    is_system_set   whether the system's clock was ever set.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self.estimated: Callable[[float], int | None] = lambda monotonic: None
        self.leaps: Leaps | None = None
        self.is_system_good = False
        self.is_system_set: Callable[[], bool] = lambda: True
        self._clock = clock
        self._sure: Told | None = None
        self._unsure: Told | None = None
        self._second: Told | None = None  # of the last pulse that was announced
        self._placed: tuple[Fix, int] | None = None  # the last epoch whose time was estimated as well

    def fix(self, fix: Fix) -> None:
        """Note the time of an epoch, whatever it says of the place."""
        told = self.told(fix)
        if told is None:
            return
        if fix.utc_accuracy_ns is None:
            self._unsure = told
        else:
            self._sure = told

    def time_mark(self, mark: TimeMark) -> None:
        """Note the second of a pulse to come, which needs no leap seconds."""
        if mark.its_s is not None and mark.is_locked:
            self._second = Told(mark.its_s * 1000, mark.monotonic)

    def its_ms(self, monotonic: float) -> int | None:
        """ITS time of a moment of the monotonic clock; None where nobody knows the time."""
        estimated = self.estimated(monotonic)
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
        """ITS time of the epoch of a fix: its receiver knows that best, but for a second that the estimate denies."""
        if self._placed is not None and self._placed[0] is fix:  # it is asked for with each packet that leaves
            return self._placed[1]
        estimated = self.estimated(fix.monotonic)
        if estimated is None:
            return self.its_ms(fix.monotonic)
        told = self.told(fix)
        is_agreed = told is not None and -SLACK_MS <= estimated - told.its_ms <= LATEST_MS
        self._placed = fix, round(told.its_ms) if told is not None and is_agreed else estimated
        return self._placed[1]

    def told(self, fix: Fix) -> Told | None:
        """ITS time of an epoch as its receiver says it, at the moment of the monotonic clock when it came."""
        if fix.utc_ns is None or not EPOCH <= fix.utc_ns / 1e9 < ITS_END:
            return None
        return self._by_week(fix) or Told(self._its_ns(fix.utc_ns) / 1e6, fix.monotonic)

    def _by_week(self, fix: Fix) -> Told | None:
        """By its time of week and the week of the last mark; None where that has none, or says something else."""
        if fix.tow_ms is None or self._second is None:
            return None
        near_ms = self._second.at(fix.monotonic) + GPS_LEAD * 1000
        ahead_ms = (fix.tow_ms - near_ms + WEEK_MS // 2) % WEEK_MS - WEEK_MS // 2
        is_agreed = abs(ahead_ms) <= 2000  # a mark is of the second to come, and an epoch of one that was
        return Told(near_ms + ahead_ms - GPS_LEAD * 1000, fix.monotonic) if is_agreed else None

    def _its_ns(self, unix_ns: int) -> int:
        if self.leaps is None:
            return unix_ns + (leap_seconds(unix_ns / 1e9) - EPOCH) * 10**9
        return self.leaps.its_ns(unix_ns)

    def _its_s(self, system_s: float) -> float:
        """By the system's clock. Which of two seconds with one number it is, CLOCK_TAI tells, if it counts as we do."""
        system_ns = round(system_s * 1e9)
        if self.leaps is not None:
            lead_s = round(time.clock_gettime(time.CLOCK_TAI) - time.clock_gettime(time.CLOCK_REALTIME))
            by_kernel_ns = system_ns + (lead_s - TAI_LEAD) * 10**9
            if self.leaps.unix_ns(by_kernel_ns) == system_ns:
                return by_kernel_ns / 1e9
        return self._its_ns(system_ns) / 1e9
