"""Robust line through the first pulses, or the first after a long silence."""

from itertools import combinations
from statistics import median
from typing import NamedTuple

# Pulses needed for a line; of fewer, two late ones could spoil it.
ENOUGH = 8


class Line(NamedTuple):
    """Line: phase_ns at moment_s, changing by rate_ppb.

    mean_ns  mean deviation of the pulses from the line.
    span_s   time from the first pulse to the last.
    """

    moment_s: float
    phase_ns: float
    rate_ppb: float
    mean_ns: float
    span_s: float


class Settling:
    """Collects pulses until there are enough for a line.

    rate_ppb  rate known before them; None at the first start.
    """

    def __init__(self, rate_ppb: float | None) -> None:
        self._rate_ppb = rate_ppb
        self._readings: list[tuple[float, float]] = []

    def reading(self, moment_s: float, phase_ns: float) -> Line | None:
        """Add a pulse; return the line when there are ENOUGH pulses."""
        self._readings.append((moment_s, phase_ns))
        return self._line() if len(self._readings) >= ENOUGH else None

    def _line(self) -> Line:
        rate_ppb = self._rate()
        levels = self._levels(rate_ppb)
        phase_ns = median(levels[ENOUGH // 4 :])  # without the lowest levels, which come from late pulses
        first_s, last_s = self._readings[0][0], self._readings[-1][0]
        return Line(last_s, phase_ns, rate_ppb, 1.2 * _spread(levels, phase_ns), last_s - first_s)

    def _rate(self) -> float:
        """Return the median slope of all pairs (Theil-Sen), or the previously known rate if it fits as well."""
        first, last = self._readings[0], self._readings[-1]
        slope = median((b[1] - a[1]) / (b[0] - a[0]) for a, b in combinations(self._readings, 2))
        if self._rate_ppb is None:
            return slope
        levels = self._levels(slope)
        differ_ns = abs(slope - self._rate_ppb) * (last[0] - first[0])
        return self._rate_ppb if differ_ns < 4 * _spread(levels, median(levels)) else slope

    def _levels(self, rate_ppb: float) -> list[float]:
        """Return the current phase by each of the pulses, in ascending order: late pulses come first."""
        now_s = self._readings[-1][0]
        return sorted(phase_ns + rate_ppb * (now_s - moment_s) for moment_s, phase_ns in self._readings)


def _spread(levels: list[float], centre: float) -> float:
    return median(abs(level - centre) for level in levels)
