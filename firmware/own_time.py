"""What time it is for the station: a receiver's time, aged by the monotonic clock, else that of the system's clock."""

import time
from collections.abc import Callable

from board.time import EPOCH, Fix, TimeMark, its_time_ms, leap_seconds

# The monotonic clock of a board is wrong by 50 ppm: 0.2 s after an hour. Then the system's clock is the better one,
# where it is set at all.
HOLDOVER_S = 3600.0
GPS_LEAPS = 13  # GPS time less UTC on 2004-01-01, where ITS time begins to count leap seconds
END = 2**42 // 1000 + EPOCH - 100  # ITS time has no number for what is later, in 2143


class OwnTime:
    """Takes what receivers say of time.

    A receiver that does not say how exact its time is may count leap seconds as its firmware guesses them: such a
    time stands in for a clock that is not set, and for none that is.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._sure: Fix | None = None
        self._unsure: Fix | None = None
        self._leap_seconds: int | None = None

    def fix(self, fix: Fix) -> None:
        """Note the time of an epoch, whatever it says of the place."""
        if fix.utc_ns is None or not EPOCH <= fix.utc_ns / 1e9 < END:
            return
        if fix.utc_accuracy_ns is None:
            self._unsure = fix
        else:
            self._sure = fix

    def time_mark(self, mark: TimeMark) -> None:
        """Note the leap seconds that satellites tell: they hold until others are told."""
        if mark.leap_seconds is not None:
            self._leap_seconds = mark.leap_seconds - GPS_LEAPS

    def its_ms(self, monotonic: float) -> int | None:
        """ITS time of a moment of the monotonic clock; None where nobody knows the time."""
        utc_s = self._utc_s(monotonic)
        if not EPOCH <= utc_s < END:
            return None
        return its_time_ms(utc_s, leap_seconds(utc_s) if self._leap_seconds is None else self._leap_seconds)

    def _utc_s(self, monotonic: float) -> float:
        now = self._clock()
        if self._sure is not None and now - self._sure.monotonic <= HOLDOVER_S:
            return _aged(self._sure, monotonic)
        system_s = time.time() - (now - monotonic)
        known = self._sure or self._unsure
        return _aged(known, monotonic) if known is not None and system_s < EPOCH else system_s


def _aged(fix: Fix, monotonic: float) -> float:
    assert fix.utc_ns is not None
    return fix.utc_ns / 1e9 + monotonic - fix.monotonic
