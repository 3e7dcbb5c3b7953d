"""Sample of numbers: mean, extremes and quantiles in bounded memory."""

import math
from array import array
from collections.abc import Sequence

MOST = 65_536


class Sample:
    """Numbers, of which all are kept up to a limit.

    Beyond the limit every second number is kept, then every fourth and so on, evenly over time.

    Count, mean, least and most always include all numbers.
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
        """Mean of all numbers; NaN for an empty sample."""
        return self.total / self.count if self.count else math.nan

    def values(self) -> Sequence[float]:
        """Return the kept numbers in the order of arrival."""
        return self._values

    def quantiles(self, *shares: float, most: int = MOST) -> list[float]:
        """Return, for each share, the smallest kept number that this share of the kept ones does not exceed.

        The share 0.5 gives the median. Without numbers, all results are NaN.

        most  limit of numbers that are sorted, taken evenly over time, because sorting is slow.
        """
        if not self._values:
            return [math.nan] * len(shares)
        ordered = sorted(self._values[:: -(-len(self._values) // most)])
        return [ordered[min(len(ordered), max(1, math.ceil(share * len(ordered)))) - 1] for share in shares]
