"""When each recorded message is due."""

from dataclasses import dataclass

from board.errors import UsageError

RATE_HZ = 10.0  # of what has no time of its own: CAMs of one station (EN 302 637-2 clause 6.1.3, T_GenCamMin)
STEP_BACK_S = 1.0  # frames of several interfaces may be recorded that much out of order


@dataclass(frozen=True)
class Timing:
    """What a user wants.

    speed   so many times as fast as it was recorded.
    rate    a second, whatever was recorded; 0: as fast as they go; None: as recorded.
    from_s  seconds from the first on that are left out. to_s: what is recorded later is left out.
    longest_gap_s  what is recorded longer apart, because nothing came or a clock was set, is replayed so far apart.
    """

    speed: float = 1.0
    rate: float | None = None
    from_s: float = 0.0
    to_s: float | None = None
    longest_gap_s: float = 60.0

    @property
    def is_cut(self) -> bool:
        return self.from_s > 0.0 or self.to_s is not None


class Schedule:
    """One round. What was recorded a little before the one in front of it is due with that.

    steps  gaps that were cut, and clocks that were set back: how often.
    """

    def __init__(self, timing: Timing) -> None:
        self._timing = timing
        self._first_ns: int | None = None
        self.steps = 0
        self._count = 0
        self._last = 0.0
        self._latest = 0.0  # of the recording, in seconds from the first on
        self._stepped = 0.0  # by which that is less than the recorded times say

    def due(self, when_ns: int | None) -> float | None:
        """Seconds from the beginning of the round; None for what is left out.

        when_ns  when it was recorded, Unix time. Raises UsageError where that is not known, and a part is asked for.
        """
        if self._first_ns is None:
            self._first_ns = when_ns
        at = None if when_ns is None or self._first_ns is None else self._smoothed((when_ns - self._first_ns) / 1e9)
        if self._timing.is_cut and not self._is_within(at):
            return None
        self._last = self._next(at)
        self._count += 1
        return self._last

    @property
    def end(self) -> float:
        """When another round may begin: as long after the last as they were apart."""
        if self._timing.rate is not None:
            return self._last + (1 / self._timing.rate if self._timing.rate else 0.0)
        return self._last + (self._last / (self._count - 1) if self._count > 1 else 1 / RATE_HZ)

    def _smoothed(self, at: float) -> float:
        """Without steps of a clock: from 1970 to the present, say, when it was set at last."""
        longest = self._timing.longest_gap_s
        gap = at - self._stepped - self._latest
        if not -STEP_BACK_S <= gap <= longest:
            self.steps += 1
            self._stepped += gap - (longest if gap > 0 else 0.0)
        self._latest = max(self._latest, at - self._stepped)
        return at - self._stepped

    def _is_within(self, at: float | None) -> bool:
        if at is None:
            raise UsageError("--from and --to: what is replayed does not say when it was recorded")
        return self._timing.from_s <= at and (self._timing.to_s is None or at <= self._timing.to_s)

    def _next(self, at: float | None) -> float:
        rate = RATE_HZ if self._timing.rate is None else self._timing.rate
        if self._timing.rate is not None or at is None:
            return self._last + (1 / rate if rate and self._count else 0.0)
        return max(self._last, (at - self._timing.from_s) / self._timing.speed)
