"""A pulse as the kernel saw it, the three clocks that it is seen by, and what sources of pulses have in common."""

import time
from typing import NamedTuple, Protocol

from board.errors import InterfaceError

# Four readings take 0.4 us on a PC and 2 us on a Pi 4. Whoever needed longer was interrupted between two of them:
# read again, as often as this; an emulator, which always needs longer, has the best of all.
TIGHT_NS = 5_000
MORE_READINGS = 3

# A stamp that is older when it is taken is of no use: the clocks of now do not tell what the others were then, since
# they are steered against each other (at 100 ppm it would be 25 us). One of the future: the clock was stepped since.
OLDEST_NS = 250_000_000

EXTRA_NS = 500_000_000  # two pulses of a receiver are never nearer to each other

# Edges that follow each other so soon come from a wire that bounces or from something else than seconds: after each
# of them a source rests, so that it takes 20 in a second at most. The newest is had after the rest.
STORM_NS = 100_000_000
REST_S = 0.05


class Clocks(NamedTuple):
    """The machine's clocks, read together.

    system_ns  CLOCK_REALTIME: Unix time as the machine has it; the kernel stamps pulses and packets with it, and it
               is stepped and slewed.
    raw_ns     CLOCK_MONOTONIC_RAW: the oscillator alone, which nobody steers.
    monotonic  CLOCK_MONOTONIC in seconds: the loop's clock.
    """

    system_ns: int
    raw_ns: int
    monotonic: float


class Pulse(NamedTuple):
    """An edge that begins a second, by each clock.

    sequence   the kernel's count of edges; it wraps at 2**32.
    The kernel has stamped it by one of the clocks: system_ns (pps.device) or monotonic (pps.edges). The others are
    found from that when the edge is taken.
    """

    sequence: int
    system_ns: int
    raw_ns: int
    monotonic: float


class Above(Protocol):
    """What a source of pulses tells, on the loop."""

    def pulse(self, pulse: Pulse) -> None:
        """An edge, in the order of their sequence."""

    def missed(self, count: int) -> None:
        """So many edges were counted by the kernel and not taken in time: their stamps are overwritten."""

    def failed(self, error: InterfaceError) -> None:
        """No more edges come from here: it was closed, and start() may be tried again later."""


class Tally:
    """Tells pulses above, with those that are missing between them, and counts.

    taken   told.
    missed  counted by the kernel, and told as missed.
    extra   of those taken: came within EXTRA_NS of the one before.
    """

    def __init__(self, above: Above) -> None:
        self.taken = self.missed = self.extra = 0
        self._above = above
        self._sequence: int | None = None
        self._raw_ns: int | None = None

    def begin(self, sequence: int) -> None:
        """A source is open: the edges up to this sequence were before its time."""
        self._sequence = sequence
        self._raw_ns = None

    def take(self, pulse: Pulse) -> None:
        """Tell of an edge; of none after end(), which may come meanwhile."""
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
        """The source is closed."""
        self._sequence = None


class Pulses(Protocol):
    """A source of pulses: pps.device, pps.edges or pps.simulated."""

    @property
    def where(self) -> str:
        """The device or line, for messages."""

    @property
    def tally(self) -> Tally:
        """What has come so far; goes on when it is started again."""

    def start(self) -> None:
        """Tell pulses above from now on; nothing while started. Raises InterfaceError where they cannot be had."""

    def stop(self) -> None:
        """Tell no more, and return at once; idempotent."""


def read_clocks() -> Clocks:
    """The clocks of now, each within TIGHT_NS of the others as far as the machine lets us."""
    reading = _reading()
    for _ in range(MORE_READINGS):
        if reading[0] <= TIGHT_NS:
            break
        reading = min(reading, _reading())
    return reading[1]


def pulse_at(sequence: int, stamp_ns: int, now: Clocks) -> Pulse:
    """The pulse of a stamp by the system's clock, taken soon after it: in between, that clock was not stepped."""
    ago_ns = now.system_ns - stamp_ns
    return Pulse(sequence, stamp_ns, now.raw_ns - ago_ns, now.monotonic - ago_ns / 1e9)


def _reading() -> tuple[int, Clocks]:
    """How long it took, in ns, and the clocks: the raw one as it was in the middle."""
    first_ns = time.clock_gettime_ns(time.CLOCK_MONOTONIC_RAW)
    system_ns = time.clock_gettime_ns(time.CLOCK_REALTIME)
    monotonic = time.monotonic()
    took_ns = time.clock_gettime_ns(time.CLOCK_MONOTONIC_RAW) - first_ns
    return took_ns, Clocks(system_ns, first_ns + took_ns // 2, monotonic)
