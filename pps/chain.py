"""Seconds that follow each other by the raw clock: what a pulse's second is held against."""

from collections import deque
from itertools import combinations
from statistics import median
from typing import NamedTuple

SECOND_NS = 1_000_000_000

# A crystal without an oven is 50 ppm wrong at most from -40 to 85 degrees, and one of a virtual machine follows that
# of its host: twice as much, less what is known of its rate, is no crystal.
DRIFT_PPM = 100

# An interrupt that is later than this is no time of anything; what is later by less is for the estimator to judge.
EDGE_NS = 5_000_000

# The drift leaves no doubt which second it is until it may have made up 0.4 s: 4000 s, 67 minutes.
DOUBT_NS = 400_000_000
LIFE_NS = DOUBT_NS * 1_000_000 // DRIFT_PPM

_DRIFT_NS = SECOND_NS * DRIFT_PPM // 1_000_000  # per second
# The edges by which it is told where the next one is to be. Up to half of them may be late: an interrupt that waits is.
REMEMBERED = 12
# An edge so much before its place is no pulse, which is never early: what the oscillator turns by meanwhile, per second
# that it was alone (a change of 10 K makes 3 ppm), and what is left of the jitter of those remembered.
EARLY_NS, TURN_NS, JITTERS = 15_000, 5_000, 6
UNSURE_NS = 500_000  # with fewer than ENOUGH of them
ENOUGH = 4

_LEARNT = 1 / 16  # of what a second shows of the rate: some 16 s of memory, against latencies that differ by some us


class Place(NamedTuple):
    """Where an edge stands beside a chain.

    its_s     the second that is nearest to it. error_ns: by how much it comes after that.
    is_whole  whether that much may be drift and latency.
    """

    its_s: int
    error_ns: int
    is_whole: bool


class Chain:
    """Counts seconds from one edge to the next, over as many as are missing between them.

    Its grid follows the edges by no more than the oscillator can drift: a late interrupt hardly moves it, so that
    those behind a burst of them are not called early.

    raw_ns    CLOCK_MONOTONIC_RAW of the grid at its last edge. its_s: the second of that edge.
    since_ns  of its first edge. count: of its edges.
    """

    __slots__ = ("_edges", "_period_ns", "count", "its_s", "raw_ns", "since_ns")

    def __init__(self, raw_ns: int, its_s: int) -> None:
        self.raw_ns = self.since_ns = raw_ns
        self.its_s = its_s
        self.count = 1
        self._period_ns = float(SECOND_NS)
        self._edges = deque([(its_s, raw_ns)], maxlen=REMEMBERED)

    def place(self, raw_ns: int) -> Place:
        """Where an edge stands."""
        elapsed = raw_ns - self.raw_ns
        seconds = round(elapsed / self._period_ns)
        error = elapsed - round(seconds * self._period_ns)
        return Place(self.its_s + seconds, error, abs(error) <= EDGE_NS + abs(seconds) * _DRIFT_NS)

    def is_over(self, raw_ns: int, life_ns: int) -> bool:
        """Whether an edge is further behind the last than that."""
        return raw_ns - self.raw_ns > life_ns

    def extend(self, raw_ns: int, its_s: int, error_ns: int) -> None:
        """Count an edge of a later second, as it stands beside the chain."""
        seconds = its_s - self.its_s
        most = seconds * _DRIFT_NS
        drift = max(-most, min(most, error_ns))
        period = self._period_ns + drift / seconds * _LEARNT
        self._period_ns = max(SECOND_NS - _DRIFT_NS, min(SECOND_NS + _DRIFT_NS, period))
        self.raw_ns = raw_ns - error_ns + drift
        self.its_s = its_s
        self.count += 1
        self._edges.append((its_s, raw_ns))

    def expected(self, its_s: int) -> tuple[float, float]:
        """Where the edge of a second to come is to be by the raw clock, and how much before that no pulse can be.

        By the medians of the edges remembered, which late ones do not move (Theil and Sen). 100 us of work.
        """
        edges = self._edges
        if len(edges) < ENOUGH:
            return self.raw_ns + (its_s - self.its_s) * self._period_ns, UNSURE_NS
        slope = median((b[1] - a[1]) / (b[0] - a[0]) for a, b in combinations(edges, 2))
        levels = [raw_ns - slope * (second - its_s) for second, raw_ns in edges]
        level = median(levels)
        jitter = median(abs(one - level) for one in levels)
        return level, min(UNSURE_NS, EARLY_NS + TURN_NS * (its_s - self.its_s) + JITTERS * jitter)
