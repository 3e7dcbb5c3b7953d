"""The three clocks of a machine over one oscillator: one that nobody steers, one that is steered, one of the loop."""

from bisect import bisect_right
from collections.abc import Callable

from board.leaps import BUILT_IN
from pps.pulse import Clocks

from .oscillator import Oscillator


class Machine:
    """A computer's clocks. True time is ITS time in ns.

    system_error_ns  of the system's clock against the truth at the start.
    monotonic_s      the loop's clock at the start.

    What steers the system's clock is told in the order of time: step() and slew().
    """

    def __init__(self, oscillator: Oscillator, system_error_ns: int = 0, monotonic_s: float = 5.0) -> None:
        self.oscillator = oscillator
        start_ns = BUILT_IN.unix_ns(oscillator.start_its_ns) + system_error_ns
        self._raws = [oscillator.start_raw_ns]  # since when the entries of the other two hold
        self._systems = [(start_ns, monotonic_s, 0.0)]  # system's and loop's clock then, ppb they are slewed by

    def clocks(self, its_ns: int) -> Clocks:
        """What all three show at a true time."""
        return self.clocks_at(self.oscillator.raw_ns(its_ns))

    def clocks_at(self, raw_ns: int) -> Clocks:
        """What the others show when the oscillator shows this."""
        number = bisect_right(self._raws, raw_ns) - 1
        system_ns, monotonic_s, slew_ppb = self._systems[number]
        since_ns = raw_ns - self._raws[number]
        since_ns += round(since_ns * slew_ppb * 1e-9)
        return Clocks(system_ns + since_ns, raw_ns, monotonic_s + since_ns * 1e-9)

    def step(self, its_ns: int, by_ns: int) -> None:
        """The system's clock is set forward by so much at a true time (back, where negative), whoever does it."""
        self._steer(its_ns, by_ns, lambda ppb: ppb)

    def slew(self, its_ns: int, ppb: float) -> None:
        """From a true time on, the system's clock and the loop's run faster than the oscillator by so much."""
        self._steer(its_ns, 0, lambda _: ppb)

    def system_offset_ns(self, its_ns: int) -> int:
        """True time less the system's clock: what TimeQuality.offset_ns is an estimate of."""
        return BUILT_IN.unix_ns(its_ns) - self.clocks(its_ns).system_ns

    def _steer(self, its_ns: int, by_ns: int, ppb: Callable[[float], float]) -> None:
        clocks = self.clocks(its_ns)
        assert clocks.raw_ns >= self._raws[-1], "clocks are steered in the order of time"
        self._raws.append(clocks.raw_ns)
        self._systems.append((clocks.system_ns + by_ns, clocks.monotonic, ppb(self._systems[-1][2])))
