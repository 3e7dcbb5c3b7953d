"""Back-off between connection attempts: doubles, except after losses of the network."""

from collections.abc import Callable

# After a connection that was up for at least this time, the first delay is used again.
STEADY_S = 10.0

# Longest delay while this machine has no network. A try then does not load the broker, and a tunnel ends soon.
AWAY_S = 2.0


class Backoff:
    """Delays between tries, doubled from first_s to longest_s.

    jitter  function that returns a number from 0 to 1. A delay is shortened at random, at most to its half, so that
            stations do not all reconnect at the same time.
    """

    def __init__(self, first_s: float, longest_s: float, jitter: Callable[[], float]) -> None:
        self._first_s = first_s
        self._longest_s = longest_s
        self._jitter = jitter
        self._failures = 0

    def reset(self) -> None:
        """Use the first delay for the next failure."""
        self._failures = 0

    def failed(self, is_away: bool = False) -> float:
        """Return the seconds to wait after a failed try.

        is_away  this machine has no network, so the try did not reach the broker.
        """
        self._failures += 1
        return self._delay(AWAY_S if is_away else self._longest_s)

    def lost(self, was_good: bool) -> float:
        """Return the seconds to wait after a lost connection.

        was_good  the connection had lasted for STEADY_S, or the network cut it: the first delay is used.
        """
        self._failures = 0 if was_good else self._failures + 1
        return self._delay(self._longest_s)

    def _delay(self, longest_s: float) -> float:
        return min(longest_s, self._first_s * 2.0 ** min(self._failures, 16)) * (0.5 + self._jitter() / 2)
