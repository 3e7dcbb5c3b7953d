"""What time it is by a receiver's messages alone: never before their epoch, and hardly more than 300 ms after it."""

from pps.chain import DRIFT_PPM

# Between the epoch of a message and its last octet: computing 40 to 100 ms, the line 3 to 100 ms (100 octets of NAV-PVT
# at 38,400 baud take 26 ms, a burst of NMEA 150 ms), and the host.
MOST_NS = 300_000_000

# Messages that speak against those before them, and for each other, are believed after as long as those had agreed, or
# after so long: a receiver has been told the leap seconds by then, as pps.timemark has it.
CONTRADICTED_NS = 780 * 10**9


class Bounds:
    """What messages that agree leave for the truth: ITS time less the raw clock is between low_ns and high_ns.

    since_ns, at_ns  raw clock of the first and the last of them. count: how many they are.
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
        """Both at a moment of the raw clock: the oscillator may have gone either way."""
        wander_ns = abs(raw_ns - self.at_ns) * DRIFT_PPM // 1_000_000
        return self.low_ns - wander_ns, self.high_ns + wander_ns

    def agree(self, its_ns: int, raw_ns: int) -> bool:
        """Take a message in, unless nothing would be left."""
        low_ns, high_ns = self.at(raw_ns)
        low_ns, high_ns = max(low_ns, its_ns - raw_ns), min(high_ns, its_ns - raw_ns + MOST_NS)
        if high_ns < low_ns:
            return False
        self.low_ns, self.high_ns, self.at_ns = low_ns, high_ns, raw_ns
        self.count += 1
        return True


class Messages:
    """Bounds on the true time by messages: the one that was least late gives the lower bound.

    What the oscillator has counted since the others speaks against a message that is later than messages are, and
    against an epoch that is another second.
    """

    def __init__(self) -> None:
        self._bounds: Bounds | None = None
        self._others: Bounds | None = None  # of those that speak against them

    def message(self, its_ns: int, raw_ns: int) -> None:
        """A message of this epoch came at this moment of the raw clock."""
        if self._bounds is None:
            self._bounds = Bounds(its_ns, raw_ns)
        elif self._bounds.agree(its_ns, raw_ns):
            self._others = None
        elif self._others is None or not self._others.agree(its_ns, raw_ns):
            self._others = Bounds(its_ns, raw_ns)
        elif self._others.span_ns >= min(CONTRADICTED_NS, self._bounds.span_ns):
            self._bounds, self._others = self._others, None

    def count_otherwise(self, by_ns: int) -> None:
        """Leap seconds are others than was thought, and ITS time of the same messages later by so much."""
        for bounds in (self._bounds, self._others):
            if bounds is not None:
                bounds.low_ns += by_ns
                bounds.high_ns += by_ns

    def estimate(self, raw_ns: int) -> tuple[int, int] | None:
        """True time (ITS ns) at a moment of the raw clock, and how far it may be off; None without messages."""
        if self._bounds is None:
            return None
        low_ns, high_ns = self._bounds.at(raw_ns)
        return raw_ns + (low_ns + high_ns) // 2, (high_ns - low_ns + 1) // 2
