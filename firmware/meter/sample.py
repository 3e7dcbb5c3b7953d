"""Numbers of which mean, extremes and quantiles are wanted, in bounded memory."""

import math
from array import array
from collections.abc import Sequence

MOST = 65_536


class Sample:
    """All numbers until there are too many; then every second of them, then every fourth, ...: evenly over time.

    Count, mean, least and most are of all of them, whatever is kept.
    """

    __slots__ = ("_each", "_most", "_values", "count", "least", "most", "total")

    def __init__(self, most: int = MOST) -> None:
        self.count = 0
        self.total = 0.0
        self.least = math.inf
        self.most = -math.inf
        self._most = most
        self._each = 1
        self._values = array("d")

    def add(self, value: float) -> None:
        if self.count % self._each == 0:
            if len(self._values) >= self._most:
                self._values = self._values[::2]
                self._each *= 2
            if self.count % self._each == 0:
                self._values.append(value)
        self.count += 1
        self.total += value
        self.least = min(self.least, value)
        self.most = max(self.most, value)

    @property
    def mean(self) -> float:
        """NaN of nothing."""
        return self.total / self.count if self.count else math.nan

    def values(self) -> Sequence[float]:
        """What is kept, in the order in which it came."""
        return self._values

    def quantiles(self, *shares: float, most: int = MOST) -> list[float]:
        """The least number that so large a share of those kept does not exceed: 0.5 is the median. NaN of nothing.

        most  of them that are looked at, spread evenly: sorting costs.
        """
        if not self._values:
            return [math.nan] * len(shares)
        ordered = sorted(self._values[:: -(-len(self._values) // most)])
        return [ordered[min(len(ordered), max(1, math.ceil(share * len(ordered)))) - 1] for share in shares]
