"""What time it is by a receiver's messages alone: never before their epoch, and hardly more than 300 ms after it."""

from collections import deque
from collections.abc import Iterable

# Between the epoch of a message and its last octet: computing 40 to 100 ms, the line 3 to 100 ms (100 octets of NAV-PVT
# at 38,400 baud take 26 ms, a burst of NMEA 150 ms), and the host.
MOST_NS = 300_000_000

# Any crystal's frequency is within this: +-50 ppm when made, and as much by temperature and age.
CRYSTAL_PPM = 100

REMEMBERED = 16  # messages


class Messages:
    """Bounds on the true time by messages: the one that was least late gives the lower bound."""

    def __init__(self) -> None:
        self._seen: deque[tuple[int, int]] = deque(maxlen=REMEMBERED)

    def message(self, its_ns: int, raw_ns: int) -> None:
        """A message of this epoch came at this moment of the raw clock."""
        self._seen.append((its_ns, raw_ns))

    def estimate(self, raw_ns: int) -> tuple[int, int] | None:
        """True time (ITS ns) at a moment of the raw clock, and how far it may be off; None without messages."""
        if not self._seen:
            return None
        earliest_ns = max(_low(self._seen, raw_ns))
        latest_ns = min(_high(self._seen, raw_ns))
        if latest_ns < earliest_ns:  # one was later than messages are, so that its upper bound is none
            latest_ns = earliest_ns + MOST_NS
        return (earliest_ns + latest_ns) // 2, (latest_ns - earliest_ns + 1) // 2


def _low(seen: Iterable[tuple[int, int]], raw_ns: int) -> list[int]:
    return [its_ns + raw_ns - at_ns - _wander(raw_ns - at_ns) for its_ns, at_ns in seen]


def _high(seen: Iterable[tuple[int, int]], raw_ns: int) -> list[int]:
    return [its_ns + raw_ns - at_ns + _wander(raw_ns - at_ns) + MOST_NS for its_ns, at_ns in seen]


def _wander(elapsed_ns: int) -> int:
    return abs(elapsed_ns) * CRYSTAL_PPM // 1_000_000
