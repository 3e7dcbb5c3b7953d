"""Simulated crystal oscillator of a single-board computer, with temperature drift.

Its clock is CLOCK_MONOTONIC_RAW. It converts true time to clock readings and back.
"""

from dataclasses import dataclass
from math import exp, sqrt
from random import Random

from .temperature import Temperature

# 2026-06-01T00:00:00Z: default start of a simulated day.
START_NS = 707_356_805_000_000_000

# The frequency of an AT cut is a cubic function of temperature about 27 degrees, with 1.05e-4 ppm/K3 at any angle of
# the cut; the angle gives the linear term. Source: Vig, Quartz crystal resonators and oscillators, frequency against
# temperature of AT-cut crystals. Near 60 degrees, the temperature of such boards, most are at or below their upper
# turning point.
INFLECTION_C = 27.0
CUBIC_PPB = 0.105


@dataclass(frozen=True)
class Crystal:
    """Behaviour of a crystal. Frequencies are in ppb.

    offset_ppb     frequency error at INFLECTION_C, when new.
    linear_ppb, quadratic_ppb, cubic_ppb  per K, K2, K3 from there. A tuning fork has a quadratic term of -34 alone.
    thermal_s      time constant with which it follows the air temperature.
    white_ppb      deviation of the frequency from second to second.
    flicker_ppb    wander that is equal at all time scales, such as from draughts. It is the sum of four processes that
                   forget within 10, 100, 1000 and 10,000 s.
    walk_ppb       random walk, per square root of a second.
    ageing_ppb     ageing per day.
    """

    offset_ppb: float = -7_000.0
    linear_ppb: float = -300.0
    quadratic_ppb: float = 0.0
    cubic_ppb: float = CUBIC_PPB
    thermal_s: float = 90.0
    white_ppb: float = 1.0
    flicker_ppb: float = 6.0
    walk_ppb: float = 0.02
    ageing_ppb: float = 1.0

    def thermal_ppb(self, degrees_c: float) -> float:
        """Return the frequency error caused by a temperature."""
        kelvin = degrees_c - INFLECTION_C
        return kelvin * (self.linear_ppb + kelvin * (self.quadratic_ppb + kelvin * self.cubic_ppb))


def drawn(seed: int) -> Crystal:
    """Return a random crystal of the kind built into boards: within +-30 ppm, of any usual cut and stability."""
    random = Random(seed)
    return Crystal(
        offset_ppb=random.uniform(-30_000, 30_000),
        linear_ppb=random.uniform(-450, -150),
        thermal_s=random.uniform(45, 240),
        white_ppb=random.uniform(0.3, 3),
        flicker_ppb=10 ** random.uniform(0, 1.3),
        walk_ppb=10 ** random.uniform(-2.3, -1.3),
        ageing_ppb=random.uniform(-3, 3),
    )


class Oscillator:
    """Clock of a simulated crystal; it is computed second by second as far as needed, 2 us each.

    its_ns  true time of the start.
    raw_ns  reading of the clock at the start.
    """

    def __init__(
        self,
        crystal: Crystal,
        temperature: Temperature,
        seed: int,
        its_ns: int = START_NS,
        raw_ns: int = 5_000_000_000,
    ) -> None:
        self.start_its_ns, self.start_raw_ns = its_ns, raw_ns
        self._crystal, self._temperature, self._random = crystal, temperature, Random(seed)
        self._follow = 1 - exp(-1 / crystal.thermal_s)
        self._warm_c = temperature.at(0)
        self._wander = [self._random.gauss(0, crystal.flicker_ppb / 2) for _ in range(4)]
        self._walk = 0.0
        self._ahead_ns = [0.0]  # clock minus true time, at each whole second since the start

    def raw_ns(self, its_ns: int) -> int:
        """Return the clock's reading at a true time, which must not be before the start."""
        second, into_ns = divmod(its_ns - self.start_its_ns, 1_000_000_000)
        self._grow(second + 1)
        ahead = self._ahead_ns[second]
        ahead += (self._ahead_ns[second + 1] - ahead) * into_ns * 1e-9
        return self.start_raw_ns + its_ns - self.start_its_ns + round(ahead)

    def its_ns(self, raw_ns: int) -> int:
        """Return the true time of a clock reading."""
        its_ns = self.start_its_ns + raw_ns - self.start_raw_ns
        for _ in range(3):  # each step leaves a ten-thousandth of the error: below 1 ns after days
            its_ns -= self.raw_ns(max(its_ns, self.start_its_ns)) - raw_ns
        return its_ns

    def frequency_ppb(self, its_ns: int) -> float:
        """Return the frequency error in the second of a true time: positive if the clock runs fast."""
        second = (its_ns - self.start_its_ns) // 1_000_000_000
        self._grow(second + 1)
        return self._ahead_ns[second + 1] - self._ahead_ns[second]

    def _grow(self, second: int) -> None:
        for number in range(len(self._ahead_ns) - 1, second):
            self._ahead_ns.append(self._ahead_ns[-1] + self._step_ppb(number))

    def _step_ppb(self, second: int) -> float:
        """Return the frequency error of the next second; 1 ppb is 1 ns in it."""
        crystal, gauss, wander = self._crystal, self._random.gauss, self._wander
        self._warm_c += (self._temperature.at(second) - self._warm_c) * self._follow
        fast = second % 10 == 0  # the slow processes need an update only every tenth second
        for number, memory_s in _WANDER if fast else _QUICK:
            wander[number] += gauss(0, crystal.flicker_ppb * sqrt(0.5 / memory_s)) - wander[number] / memory_s
        if fast:
            self._walk += gauss(0, crystal.walk_ppb * 3.16)
        steady = crystal.offset_ppb + crystal.ageing_ppb * second / 86400 + crystal.thermal_ppb(self._warm_c)
        return steady + self._walk + sum(wander) + gauss(0, crystal.white_ppb)


# Flicker processes, and how many of their own steps each remembers: two step every second, all four every tenth.
_QUICK = ((0, 10.0), (1, 100.0))
_WANDER = (*_QUICK, (2, 100.0), (3, 1000.0))
