"""Time from a receiver's messages alone: up to 300 ms after their epoch."""

from pps.chain import DRIFT_PPM

# Longest time from the epoch of a message to its last octet. The receiver computes for 40 to 100 ms. The line takes 3
# to 100 ms (100 octets of NAV-PVT at 38,400 baud take 26 ms, a burst of NMEA 150 ms). The host adds to it.
MOST_NS = 300_000_000

# Messages may contradict the earlier ones and agree with each other. They replace the earlier ones after as long as
# those had agreed, but at most after this time. By then a receiver knows the leap seconds, see pps.timemark.
CONTRADICTED_NS = 780 * 10**9


class Bounds:
    """Bounds of the true time from agreeing messages: ITS time minus the raw clock is between low_ns and high_ns.

    since_ns, at_ns  raw clock at the first and the last message.
    count            number of messages.
    """

    def __init__(self, its_ns: int, raw_ns: int) -> None:
        self.low_ns = its_ns - raw_ns
        self.high_ns = self.low_ns + MOST_NS
        self.since_ns = self.at_ns = raw_ns
        self.count = 1

    @property
    def span_ns(self) -> int:
        return self.at_ns - self.since_ns

    def at(self, raw_ns: int) -> tuple[int, int]:
        """Return both bounds at a moment of the raw clock, widened by the oscillator's possible drift."""
        wander_ns = abs(raw_ns - self.at_ns) * DRIFT_PPM // 1_000_000
        return self.low_ns - wander_ns, self.high_ns + wander_ns

    def agree(self, its_ns: int, raw_ns: int) -> bool:
        """Narrow the bounds by a message; return False, and change nothing, if it contradicts them."""
        low_ns, high_ns = self.at(raw_ns)
        low_ns, high_ns = max(low_ns, its_ns - raw_ns), min(high_ns, its_ns - raw_ns + MOST_NS)
        if high_ns < low_ns:
            return False
        self.low_ns, self.high_ns, self.at_ns = low_ns, high_ns, raw_ns
        self.count += 1
        return True


class Messages:
    """Bounds of the true time from messages; the least late message gives the lower bound.

    The oscillator counts the time since earlier messages. So a message that is later than messages can be, or whose
    epoch is a wrong second, contradicts the bounds.
    """

    def __init__(self) -> None:
        self._bounds: Bounds | None = None
        self._others: Bounds | None = None  # bounds from messages that contradict _bounds

    def message(self, its_ns: int, raw_ns: int) -> None:
        """Add a message: the ITS time of its epoch, and the raw clock at its arrival."""
        if self._bounds is None:
            self._bounds = Bounds(its_ns, raw_ns)
        elif self._bounds.agree(its_ns, raw_ns):
            self._others = None
        elif self._others is None or not self._others.agree(its_ns, raw_ns):
            self._others = Bounds(its_ns, raw_ns)
        elif self._others.span_ns >= min(CONTRADICTED_NS, self._bounds.span_ns):
            self._bounds, self._others = self._others, None

    def count_otherwise(self, by_ns: int) -> None:
        """Shift the bounds by by_ns, because a corrected number of leap seconds shifts the ITS time of all messages."""
        for bounds in (self._bounds, self._others):
            if bounds is not None:
                bounds.low_ns += by_ns
                bounds.high_ns += by_ns

    def estimate(self, raw_ns: int) -> tuple[int, int] | None:
        """Return true time (ITS ns) at a moment of the raw clock, and its largest error; None without messages."""
        if self._bounds is None:
            return None
        low_ns, high_ns = self._bounds.at(raw_ns)
        return raw_ns + (low_ns + high_ns) // 2, (high_ns - low_ns + 1) // 2
