"""How long a session waits before it asks its broker again: ever longer, but not for what is nobody's fault."""

from collections.abc import Callable

# A connection that was up for so long was a good one: what comes after it begins with the first delay again.
STEADY_S = 10.0

# The longest wait while this machine has no network: a try costs nobody anything, and a tunnel has an end.
AWAY_S = 2.0


class Backoff:
    """Delays between tries, doubled from first_s to longest_s.

    jitter  0 to 1: a delay is half of itself and more, so that stations do not all come back at once.
    """

    def __init__(self, first_s: float, longest_s: float, jitter: Callable[[], float]) -> None:
        self._first_s = first_s
        self._longest_s = longest_s
        self._jitter = jitter
        self._failures = 0

    def reset(self) -> None:
        """What comes next begins with the first delay."""
        self._failures = 0

    def failed(self, is_away: bool = False) -> float:
        """Seconds to wait after a try that failed. is_away: this machine has no network, and no broker was asked."""
        self._failures += 1
        return self._delay(AWAY_S if is_away else self._longest_s)

    def lost(self, was_good: bool) -> float:
        """Seconds to wait after a connection that is gone. was_good: it had lasted, or nobody has ended it."""
        self._failures = 0 if was_good else self._failures + 1
        return self._delay(self._longest_s)

    def _delay(self, longest_s: float) -> float:
        return min(longest_s, self._first_s * 2.0 ** min(self._failures, 16)) * (0.5 + self._jitter() / 2)
