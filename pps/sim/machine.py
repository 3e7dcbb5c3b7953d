"""Three simulated clocks over one oscillator: raw, steered, and the loop's."""

from bisect import bisect_right
from collections.abc import Callable

from board.time.leaps import BUILT_IN
from pps.pulse import Clocks

from .oscillator import Oscillator


class Machine:
    """Clocks of a simulated computer. True time is ITS time in ns.

    system_error_ns  error of the system's clock at the start.
    monotonic_s      the loop's clock at the start.

    Call step() and slew(), which steer the system's clock, in the order of time.
    """

    def __init__(self, oscillator: Oscillator, system_error_ns: int = 0, monotonic_s: float = 5.0) -> None:
        self.oscillator = oscillator
        start_ns = BUILT_IN.unix_ns(oscillator.start_its_ns) + system_error_ns
        self._raws = [oscillator.start_raw_ns]  # readings of the raw clock from which each entry in _systems is valid
        self._systems = [(start_ns, monotonic_s, 0.0)]  # system's and loop's clock at that moment, slew in ppb

    def clocks(self, its_ns: int) -> Clocks:
        """Return the readings of all three clocks at a true time."""
        return self.clocks_at(self.oscillator.raw_ns(its_ns))

    def clocks_at(self, raw_ns: int) -> Clocks:
        """Return the readings of all three clocks when the raw clock shows raw_ns."""
        number = bisect_right(self._raws, raw_ns) - 1
        system_ns, monotonic_s, slew_ppb = self._systems[number]
        since_ns = raw_ns - self._raws[number]
        since_ns += round(since_ns * slew_ppb * 1e-9)
        return Clocks(system_ns + since_ns, raw_ns, monotonic_s + since_ns * 1e-9)

    def step(self, its_ns: int, by_ns: int) -> None:
        """Step the system's clock forward by by_ns at a true time; backward if negative."""
        self._steer(its_ns, by_ns, lambda ppb: ppb)

    def slew(self, its_ns: int, ppb: float) -> None:
        """From a true time on, let the system's clock and CLOCK_MONOTONIC run faster than the oscillator by ppb."""
        self._steer(its_ns, 0, lambda _: ppb)

    def system_offset_ns(self, its_ns: int) -> int:
        """Return true time minus the system's clock, the value that TimeQuality.offset_ns estimates."""
        return BUILT_IN.unix_ns(its_ns) - self.clocks(its_ns).system_ns

    def _steer(self, its_ns: int, by_ns: int, ppb: Callable[[float], float]) -> None:
        clocks = self.clocks(its_ns)
        assert clocks.raw_ns >= self._raws[-1], "clocks are steered in the order of time"
        self._raws.append(clocks.raw_ns)
        self._systems.append((clocks.system_ns + by_ns, clocks.monotonic, ppb(self._systems[-1][2])))
