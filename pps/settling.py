"""The first pulses, or the first after a long silence: a line through them that a few late ones do not bend."""

from itertools import combinations
from statistics import median
from typing import NamedTuple

# Pulses that make a line: with fewer, two late ones of them could.
ENOUGH = 8


class Line(NamedTuple):
    """phase_ns at moment_s, changing by rate_ppb.

    mean_ns  mean deviation of the pulses from it. span_s: between the first of them and the last.
    """

    moment_s: float
    phase_ns: float
    rate_ppb: float
    mean_ns: float
    span_s: float


class Settling:
    """Collects pulses.

    rate_ppb  that was known before them; None at first.
    """

    def __init__(self, rate_ppb: float | None) -> None:
        self._rate_ppb = rate_ppb
        self._readings: list[tuple[float, float]] = []

    def reading(self, moment_s: float, phase_ns: float) -> Line | None:
        """Another pulse. Returns the line when there are ENOUGH."""
        self._readings.append((moment_s, phase_ns))
        return self._line() if len(self._readings) >= ENOUGH else None

    def _line(self) -> Line:
        rate_ppb = self._rate()
        levels = self._levels(rate_ppb)
        phase_ns = median(levels[ENOUGH // 4 :])  # late pulses are below the others
        first_s, last_s = self._readings[0][0], self._readings[-1][0]
        return Line(last_s, phase_ns, rate_ppb, 1.2 * _spread(levels, phase_ns), last_s - first_s)

    def _rate(self) -> float:
        """The median of the slopes of all pairs (Theil-Sen), or the rate known before if that fits as well."""
        first, last = self._readings[0], self._readings[-1]
        slope = median((b[1] - a[1]) / (b[0] - a[0]) for a, b in combinations(self._readings, 2))
        if self._rate_ppb is None:
            return slope
        levels = self._levels(slope)
        differ_ns = abs(slope - self._rate_ppb) * (last[0] - first[0])
        return self._rate_ppb if differ_ns < 4 * _spread(levels, median(levels)) else slope

    def _levels(self, rate_ppb: float) -> list[float]:
        """Where the line would be now by each of the pulses, from the latest to the earliest."""
        now_s = self._readings[-1][0]
        return sorted(phase_ns + rate_ppb * (now_s - moment_s) for moment_s, phase_ns in self._readings)


def _spread(levels: list[float], centre: float) -> float:
    return median(abs(level - centre) for level in levels)
