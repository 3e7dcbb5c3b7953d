"""Simulated interrupt delay of pulse stamps."""

from collections.abc import Sequence
from random import Random

from pps.pulse import Pulse

from .machine import Machine

# A ZED-F9P's time pulse: 30 ns RMS (u-blox, ZED-F9P data sheet, "time pulse signal").
RECEIVER_NS = 30.0

# Range of the shortest path, which depends on board, kernel and processor speed. Published: 4.4 us for a Raspberry Pi 4
# (PPS-Client), 7 to 20 us for a Pi 5 (satpulse, issue 460).
SHORTEST_NS = (2_000.0, 9_000.0)

# Mean lateness beyond the shortest path on an idle machine. It gives the deviation of 0.6 us that PPS-Client's author
# measured on ten idle Raspberry Pi 4.
QUIET_NS = 500.0

# Interrupts that wait for other work: their fraction, their mean wait, and the longest wait.
QUIET_WAITS, BUSY_WAITS = 0.002, 0.15
QUIET_WAIT_NS, BUSY_WAIT_NS = 15_000.0, 40_000.0
LONGEST_NS = 500_000.0

# Time constant in s of the slow wander.
WANDER_S = 8.0


class Interrupts:
    """Simulated lateness of a kernel's stamps.

    base_ns    shortest path from the edge to the stamp; None: drawn from SHORTEST_NS.
    loads      periods of load: (from, to) in seconds after the start. Cold caches then add 1 us.
    wander_ns  standard deviation of a slow wander, within WANDER_S, as in an emulator whose host has other work.
    """

    def __init__(
        self,
        seed: int,
        base_ns: float | None = None,
        loads: Sequence[tuple[float, float]] = (),
        wander_ns: float = 0.0,
    ) -> None:
        self._random = Random(seed)
        self._base_ns = self._random.uniform(*SHORTEST_NS) if base_ns is None else base_ns
        self._loads = loads
        self._wander_ns, self._wandered_ns = wander_ns, 0.0

    def late_ns(self, second: float) -> float:
        """Return the lateness of an edge, given its time in seconds after the start."""
        random = self._random
        is_busy = any(begin <= second < end for begin, end in self._loads)
        late_ns = self._base_ns + random.expovariate(1 / QUIET_NS) + 1_000.0 * is_busy
        if random.random() < (BUSY_WAITS if is_busy else QUIET_WAITS):
            late_ns += min(LONGEST_NS, random.expovariate(1 / (BUSY_WAIT_NS if is_busy else QUIET_WAIT_NS)))
        if self._wander_ns:
            most_ns, step_ns = 3 * self._wander_ns, self._wander_ns * (2 / WANDER_S) ** 0.5
            wandered_ns = self._wandered_ns * (1 - 1 / WANDER_S) + random.gauss(0, step_ns)
            self._wandered_ns = max(-most_ns, min(most_ns, wandered_ns))
            late_ns = max(0.0, late_ns + self._wandered_ns)
        return late_ns


class Edges:
    """Simulated line whose edges the kernel stamps. The caller decides which edges occur, false ones included."""

    def __init__(self, machine: Machine, interrupts: Interrupts, seed: int) -> None:
        self._machine, self._interrupts, self._random = machine, interrupts, Random(seed)
        self._sequence = 0

    def edge(self, its_ns: int) -> Pulse:
        """Return the pulse of an edge that the receiver intends for this true time."""
        self._sequence = (self._sequence + 1) & 0xFFFFFFFF
        since_s = (its_ns - self._machine.oscillator.start_its_ns) * 1e-9
        late_ns = self._random.gauss(0, RECEIVER_NS) + self._interrupts.late_ns(since_s)
        clocks = self._machine.clocks(max(its_ns + round(late_ns), self._machine.oscillator.start_its_ns))
        return Pulse(self._sequence, clocks.system_ns, clocks.raw_ns, clocks.monotonic)

    def skip(self, count: int = 1) -> None:
        """Count edges as the kernel would, although the station misses them."""
        self._sequence = (self._sequence + count) & 0xFFFFFFFF
