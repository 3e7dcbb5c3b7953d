"""Schedule of a replay: the time of each message."""

from dataclasses import dataclass

from board.runtime.errors import UsageError

RATE_HZ = 10.0  # rate of messages without a time: CAMs of one station (EN 302 637-2 clause 6.1.3, T_GenCamMin)
STEP_BACK_S = 1.0  # frames of several interfaces may be recorded out of order by this much


@dataclass(frozen=True)
class Timing:
    """Requested times of a replay.

    speed          factor by which it is faster than the recording.
    rate           messages per second, whatever the recorded times; 0: as fast as possible; None: as recorded.
    from_s         start of the replayed part, in seconds from the first message.
    to_s           end of the replayed part, in seconds from the first message; None: the end.
    longest_gap_s  limit for silences, and for steps of a clock that was set.
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
    """Schedule of one round. A message recorded slightly before its predecessor is due together with it.

    steps  number of shortened silences and of steps of the clock.
    """

    def __init__(self, timing: Timing) -> None:
        self._timing = timing
        self._first_ns: int | None = None
        self.steps = 0
        self._count = 0
        self._last = 0.0
        self._latest = 0.0  # time of the latest message, in seconds from the first one, without the removed steps
        self._stepped = 0.0  # seconds removed for steps and long silences

    def due(self, when_ns: int | None) -> float | None:
        """Return seconds from the start of the round; None for a message outside the replayed part.

        when_ns  time of recording as Unix time in nanoseconds; None: unknown.

        Raises UsageError if a part is requested but the time of recording is unknown.
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
        """Time at which another round may begin: one mean interval after the last message."""
        if self._timing.rate is not None:
            return self._last + (1 / self._timing.rate if self._timing.rate else 0.0)
        return self._last + (self._last / (self._count - 1) if self._count > 1 else 1 / RATE_HZ)

    def _smoothed(self, at: float) -> float:
        """Return a recorded time without steps, such as that from 1970 to the present when a clock is set."""
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
