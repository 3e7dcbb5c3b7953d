"""Simulated air temperature around a crystal: hour, engine, fan and sun."""

from bisect import bisect_right
from collections.abc import Iterable
from math import cos, pi
from random import Random
from typing import NamedTuple

DAY_S = 86400


class Ramp(NamedTuple):
    """Temperature change by `kelvin`, starting at_s after the start, over over_s (0: at once); it persists."""

    at_s: float
    kelvin: float
    over_s: float = 0.0


def fan(seed: int, begin_s: float, end_s: float, kelvin: float = 6.0, period_s: float = 900.0) -> list[Ramp]:
    """Return the ramps of a fan that a thermostat switches on and off, at periods that vary."""
    random, ramps, at_s = Random(seed), [], begin_s
    while at_s + period_s < end_s:
        ramps.append(Ramp(at_s, -kelvin))
        ramps.append(Ramp(at_s + period_s * random.uniform(0.25, 0.5), kelvin))
        at_s += period_s * random.uniform(0.75, 1.25)
    return ramps


def clouds(seed: int, begin_s: float, end_s: float, kelvin: float = 5.0, mean_s: float = 1200.0) -> list[Ramp]:
    """Return the ramps of sun on the housing that clouds interrupt; each change takes two minutes."""
    random, ramps, at_s, sign = Random(seed), [], begin_s, 1
    while at_s < end_s:
        ramps.append(Ramp(at_s, sign * kelvin, 120.0))
        sign, at_s = -sign, at_s + 120.0 + random.expovariate(1 / mean_s)
    if sign < 0:
        ramps.append(Ramp(end_s + 120.0, -kelvin, 120.0))
    return ramps


def engine(at_s: float, kelvin: float = 20.0, over_s: float = 1200.0) -> list[Ramp]:
    """Return the ramps of an engine: it warms up in over_s, stays warm as long, then cools in 3 * over_s."""
    return [Ramp(at_s, kelvin, over_s), Ramp(at_s + 2 * over_s, -kelvin, 3 * over_s)]


class Temperature:
    """Air temperature in the housing, in degrees Celsius.

    mean_c      mean at the start of the first day, without the daily variation.
    diurnal_k   half the difference between the coldest and the hottest hour.
    hottest_s   hottest time, as seconds of the day.
    """

    def __init__(
        self,
        mean_c: float = 45.0,
        diurnal_k: float = 4.0,
        hottest_s: float = 15 * 3600.0,
        ramps: Iterable[Ramp] = (),
    ) -> None:
        self._mean_c, self._diurnal_k, self._hottest_s = mean_c, diurnal_k, hottest_s
        self._moments, self._levels = _corners(ramps)

    def at(self, second: float) -> float:
        """Return the temperature at a time in seconds after the start."""
        hour = self._diurnal_k * cos(2 * pi * (second - self._hottest_s) / DAY_S)
        after = bisect_right(self._moments, second)
        if after == 0:
            return self._mean_c + hour
        level = self._levels[after - 1]
        if after < len(self._moments):
            begin, end = self._moments[after - 1], self._moments[after]
            level += (self._levels[after] - level) * (second - begin) / (end - begin)
        return self._mean_c + hour + level


def _corners(ramps: Iterable[Ramp]) -> tuple[list[float], list[float]]:
    """Return the times at which the sum of all ramps bends, and the sum at each."""
    ramps = [Ramp(ramp.at_s, ramp.kelvin, max(ramp.over_s, 1.0)) for ramp in ramps]
    moments = sorted({ramp.at_s for ramp in ramps} | {ramp.at_s + ramp.over_s for ramp in ramps})
    levels = [sum(r.kelvin * min(1.0, max(0.0, (moment - r.at_s) / r.over_s)) for r in ramps) for moment in moments]
    return moments, levels
