"""A pulse as the kernel saw it, and the three clocks that it is seen by."""

import time
from typing import NamedTuple, Protocol

from board.errors import InterfaceError


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
    system_ns  as the kernel stamped it. raw_ns, monotonic: found from it when the edge was taken.
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


def read_clocks() -> Clocks:
    """The clocks of now; between the first and the last reading lie some 100 ns."""
    system_ns = time.clock_gettime_ns(time.CLOCK_REALTIME)
    raw_ns = time.clock_gettime_ns(time.CLOCK_MONOTONIC_RAW)
    return Clocks(system_ns, raw_ns, time.monotonic())


def pulse_at(sequence: int, stamp_ns: int, now: Clocks) -> Pulse:
    """The pulse of a stamp by the system's clock, taken soon after it: in between, that clock was not stepped."""
    ago_ns = now.system_ns - stamp_ns
    return Pulse(sequence, stamp_ns, now.raw_ns - ago_ns, now.monotonic - ago_ns / 1e9)
