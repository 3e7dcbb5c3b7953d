"""Counts seconds between pulses by the raw clock."""

from collections import deque
from itertools import combinations
from statistics import median
from typing import NamedTuple

SECOND_NS = 1_000_000_000

# A crystal without an oven is at most 50 ppm wrong from -40 to 85 degrees. The clock of a virtual machine follows that
# of its host. Twice that drift, after correction by the known rate, cannot come from a crystal.
DRIFT_PPM = 100

# An interrupt later than this cannot mark a second; the estimator judges interrupts that are less late.
EDGE_NS = 5_000_000

# The drift cannot confuse seconds before it amounts to 0.4 s: after 4000 s, 67 minutes.
DOUBT_NS = 400_000_000
LIFE_NS = DOUBT_NS * 1_000_000 // DRIFT_PPM

_DRIFT_NS = SECOND_NS * DRIFT_PPM // 1_000_000  # per second
# Number of edges that predict the next one. Up to half of them may be late because their interrupts waited.
REMEMBERED = 12
# Pulses are never early. So of several edges of one second, one that is earlier than a margin is used only if all are.
# The margin is EARLY_NS, plus TURN_NS per second since the last edge, plus JITTERS times the jitter of the remembered
# edges; at most UNSURE_NS. A change of 10 K makes 3 ppm.
EARLY_NS, TURN_NS, JITTERS = 15_000, 5_000, 6
UNSURE_NS = 500_000  # margin with fewer than ENOUGH remembered edges
ENOUGH = 4

_LEARNT = 1 / 16  # weight of a new rate: averages over about 16 s, because latencies differ by several us


class EdgePlace(NamedTuple):
    """Place of an edge relative to a chain.

    its_s     nearest second.
    error_ns  lateness of the edge relative to that second.
    is_whole  the error is small enough to be drift and latency.
    """

    its_s: int
    error_ns: int
    is_whole: bool


class Chain:
    """Counts seconds from one edge to the next, also over missing edges.

    The grid of seconds follows the edges by at most the possible drift of the oscillator. So a late interrupt hardly
    moves it, and edges after a burst of late ones do not appear early.

    raw_ns    CLOCK_MONOTONIC_RAW of the grid at its last edge.
    its_s     second of the last edge.
    since_ns  CLOCK_MONOTONIC_RAW of the first edge.
    count     number of edges.
    """

    __slots__ = ("_edges", "_period_ns", "count", "its_s", "raw_ns", "since_ns")

    def __init__(self, raw_ns: int, its_s: int) -> None:
        self.raw_ns = self.since_ns = raw_ns
        self.its_s = its_s
        self.count = 1
        self._period_ns = float(SECOND_NS)
        self._edges = deque([(its_s, raw_ns)], maxlen=REMEMBERED)

    def place(self, raw_ns: int) -> EdgePlace:
        """Return the place of an edge."""
        elapsed = raw_ns - self.raw_ns
        seconds = round(elapsed / self._period_ns)
        error = elapsed - round(seconds * self._period_ns)
        return EdgePlace(self.its_s + seconds, error, abs(error) <= EDGE_NS + abs(seconds) * _DRIFT_NS)

    def is_over(self, raw_ns: int, life_ns: int) -> bool:
        """Return whether an edge comes more than life_ns after the last one."""
        return raw_ns - self.raw_ns > life_ns

    def extend(self, raw_ns: int, its_s: int, error_ns: int) -> None:
        """Add an edge of a later second, with the place that place() returned."""
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
        """Predict the edge of a future second: its raw time, and the margin before it in which no pulse can be.

        Uses medians of the remembered edges, which late ones do not move (Theil and Sen). Takes 100 us.
        """
        edges = self._edges
        if len(edges) < ENOUGH:
            return self.raw_ns + (its_s - self.its_s) * self._period_ns, UNSURE_NS
        slope = median((b[1] - a[1]) / (b[0] - a[0]) for a, b in combinations(edges, 2))
        levels = [raw_ns - slope * (second - its_s) for second, raw_ns in edges]
        level = median(levels)
        jitter = median(abs(one - level) for one in levels)
        return level, min(UNSURE_NS, EARLY_NS + TURN_NS * (its_s - self.its_s) + JITTERS * jitter)
