"""A crystal oscillator as a single-board computer has it: warm, unguarded, and never the same frequency twice.

Its clock is CLOCK_MONOTONIC_RAW. The truth is known both ways: what it shows at a true time, and what is true when it
shows something.
"""

from dataclasses import dataclass
from math import exp, sqrt
from random import Random

from .temperature import Temperature

# 2026-06-01T00:00:00Z: where a simulated day begins unless it says otherwise.
START_NS = 707_356_805_000_000_000

# An AT cut's frequency is a cubic about 27 degrees, by 1.05e-4 ppm/K3 whatever its angle; the angle gives the linear
# term (Vig, Quartz crystal resonators and oscillators: frequency against temperature of AT-cut crystals). Near 60
# degrees, where such boards live, most are at or below their upper turning point.
INFLECTION_C = 27.0
CUBIC_PPB = 0.105


@dataclass(frozen=True)
class Crystal:
    """What a crystal does. Frequencies in ppb.

    offset_ppb     at INFLECTION_C, when new.
    linear_ppb, quadratic_ppb, cubic_ppb  per K, K2, K3 from there. A tuning fork has a quadratic term of -34 alone.
    thermal_s      time constant by which it follows the air.
    white_ppb      deviation of the frequency from second to second.
    flicker_ppb    what wanders at all time scales alike: here the sum of four that forget within 10, 100, 1000 and
                   10,000 s; draughts are among it.
    walk_ppb       of the random walk, per square root of a second.
    ageing_ppb     per day.
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
        """What the temperature makes of it."""
        kelvin = degrees_c - INFLECTION_C
        return kelvin * (self.linear_ppb + kelvin * (self.quadratic_ppb + kelvin * self.cubic_ppb))


def drawn(seed: int) -> Crystal:
    """One of the many that are built into boards: within +-30 ppm, cut at any angle that is usual, calm or lively."""
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
    """A clock that a crystal drives, made second by second, as far as it is asked for: 2 us of work each.

    its_ns, raw_ns  true time of the start, and what the clock shows then.
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
        self._ahead_ns = [0.0]  # of the truth, at each whole second since the start

    def raw_ns(self, its_ns: int) -> int:
        """What it shows at a true time, which is not before the start."""
        second, into_ns = divmod(its_ns - self.start_its_ns, 1_000_000_000)
        self._grow(second + 1)
        ahead = self._ahead_ns[second]
        ahead += (self._ahead_ns[second + 1] - ahead) * into_ns * 1e-9
        return self.start_raw_ns + its_ns - self.start_its_ns + round(ahead)

    def its_ns(self, raw_ns: int) -> int:
        """The true time at which it shows this."""
        its_ns = self.start_its_ns + raw_ns - self.start_raw_ns
        for _ in range(3):  # each leaves a ten-thousandth of the error: below 1 ns after days
            its_ns -= self.raw_ns(max(its_ns, self.start_its_ns)) - raw_ns
        return its_ns

    def frequency_ppb(self, its_ns: int) -> float:
        """By which it runs fast in the second of a true time."""
        second = (its_ns - self.start_its_ns) // 1_000_000_000
        self._grow(second + 1)
        return self._ahead_ns[second + 1] - self._ahead_ns[second]

    def _grow(self, second: int) -> None:
        for number in range(len(self._ahead_ns) - 1, second):
            self._ahead_ns.append(self._ahead_ns[-1] + self._step_ppb(number))

    def _step_ppb(self, second: int) -> float:
        """The frequency of the next second: 1 ppb is 1 ns in it."""
        crystal, gauss, wander = self._crystal, self._random.gauss, self._wander
        self._warm_c += (self._temperature.at(second) - self._warm_c) * self._follow
        fast = second % 10 == 0  # what forgets within 1000 s need not be made anew each second
        for number, memory_s in _WANDER if fast else _QUICK:
            wander[number] += gauss(0, crystal.flicker_ppb * sqrt(0.5 / memory_s)) - wander[number] / memory_s
        if fast:
            self._walk += gauss(0, crystal.walk_ppb * 3.16)
        steady = crystal.offset_ppb + crystal.ageing_ppb * second / 86400 + crystal.thermal_ppb(self._warm_c)
        return steady + self._walk + sum(wander) + gauss(0, crystal.white_ppb)


# Which part of the flicker forgets within how many of its own steps: two each second, all four each tenth.
_QUICK = ((0, 10.0), (1, 100.0))
_WANDER = (*_QUICK, (2, 100.0), (3, 1000.0))
