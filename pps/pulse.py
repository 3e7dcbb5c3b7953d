"""Pulse, its three clocks, and the interface of pulse sources."""

import time
from typing import NamedTuple, Protocol

from board.runtime.errors import InterfaceError

# Four readings take 0.4 us on a PC and 2 us on a Pi 4. A slower set was interrupted and is repeated, at most
# MORE_READINGS times. The fastest set is used, as on an emulator, where all are slower.
TIGHT_NS = 5_000
MORE_READINGS = 3

# An older stamp is discarded. The clocks are steered against each other, so current readings do not give their earlier
# difference (at 100 ppm the error would be 25 us). A stamp in the future means that the clock was stepped since.
OLDEST_NS = 250_000_000

EXTRA_NS = 500_000_000  # edges closer than this to the previous one are not pulses of the receiver

# Edges closer than this come from a bouncing wire or another signal. After each of them, the source pauses for REST_S,
# so it takes at most 20 edges per second. After the pause, it takes the newest.
STORM_NS = 100_000_000
REST_S = 0.05


class Clocks(NamedTuple):
    """Clocks of the machine, read together.

    system_ns  CLOCK_REALTIME: Unix time by the machine; it stamps pulses and packets, and is stepped and slewed.
    raw_ns     CLOCK_MONOTONIC_RAW: the oscillator alone, never steered.
    monotonic  CLOCK_MONOTONIC in seconds: the loop's clock.
    """

    system_ns: int
    raw_ns: int
    monotonic: float


class Pulse(NamedTuple):
    """Edge that begins a second, by each clock.

    The kernel stamps it by one clock: system_ns (pps.device) or monotonic (pps.edges). The other times are computed
    when the edge is taken.

    sequence  the kernel's count of edges; it wraps at 2**32.
    """

    sequence: int
    system_ns: int
    raw_ns: int
    monotonic: float


class Above(Protocol):
    """Receiver of a pulse source's reports, on the loop."""

    def pulse(self, pulse: Pulse) -> None:
        """Report an edge, in the order of sequence."""

    def missed(self, count: int) -> None:
        """Report edges that the kernel counted, but whose stamps were overwritten before they were read."""

    def failed(self, error: InterfaceError) -> None:
        """Report that the source failed and is closed; start() may be retried later."""


class Tally:
    """Reports pulses and missed edges to the receiver, and counts them.

    taken   number of reported pulses.
    missed  number of edges that the kernel counted and the station missed.
    extra   number of pulses within EXTRA_NS of the previous one.
    """

    def __init__(self, above: Above) -> None:
        self.taken = self.missed = self.extra = 0
        self._above = above
        self._sequence: int | None = None
        self._raw_ns: int | None = None

    def begin(self, sequence: int) -> None:
        """Begin after the source was opened; edges up to this sequence are old."""
        self._sequence = sequence
        self._raw_ns = None

    def take(self, pulse: Pulse) -> None:
        """Report a pulse, and the edges missed before it; without effect after end(), which a report may call."""
        if self._sequence is None:
            return
        missed = (pulse.sequence - self._sequence - 1) % 2**32
        self._sequence = pulse.sequence
        self.taken += 1
        self.extra += self._raw_ns is not None and pulse.raw_ns - self._raw_ns < EXTRA_NS
        self._raw_ns = pulse.raw_ns
        if missed:
            self.missed += missed
            self._above.missed(missed)
        if self._sequence is not None:
            self._above.pulse(pulse)

    def end(self) -> None:
        """End, because the source is closed."""
        self._sequence = None


class Pulses(Protocol):
    """Source of pulses: pps.device, pps.edges or pps.simulated."""

    @property
    def where(self) -> str:
        """Device or line, for messages."""

    @property
    def tally(self) -> Tally:
        """Counts so far; they continue after a restart."""

    def start(self) -> None:
        """Start reporting pulses; without effect if started. Raises InterfaceError if the source cannot be opened."""

    def stop(self) -> None:
        """Stop reporting, and return at once; idempotent."""


def read_clocks() -> Clocks:
    """Return the clocks, read within TIGHT_NS of each other if possible."""
    reading = _reading()
    for _ in range(MORE_READINGS):
        if reading[0] <= TIGHT_NS:
            break
        reading = min(reading, _reading())
    return reading[1]


def pulse_at(sequence: int, stamp_ns: int, now: Clocks) -> Pulse:
    """Return the pulse of a stamp by the system's clock, which must not have been stepped since."""
    ago_ns = now.system_ns - stamp_ns
    return Pulse(sequence, stamp_ns, now.raw_ns - ago_ns, now.monotonic - ago_ns / 1e9)


def _reading() -> tuple[int, Clocks]:
    """Return the duration of the reading in ns, and the clocks; the raw clock is that of the middle."""
    first_ns = time.clock_gettime_ns(time.CLOCK_MONOTONIC_RAW)
    system_ns = time.clock_gettime_ns(time.CLOCK_REALTIME)
    monotonic = time.monotonic()
    took_ns = time.clock_gettime_ns(time.CLOCK_MONOTONIC_RAW) - first_ns
    return took_ns, Clocks(system_ns, first_ns + took_ns // 2, monotonic)
