"""Kernel's own statement about its clock, read with adjtimex(2)."""

import ctypes
import struct
from enum import IntEnum
from functools import cache
from typing import Any, NamedTuple

from board.runtime.errors import InterfaceError

# struct timex of <sys/timex.h>: modes; offset, freq, maxerror, esterror; status; constant, precision, tolerance;
# time (2); tick, ppsfreq, jitter; shift; stabil, jitcnt, calcnt, errcnt, stbcnt; tai; eleven spare ints.
TIMEX = struct.Struct("@I4li3l2l3li5li44x")

STA_INS, STA_DEL, STA_UNSYNC = 0x0010, 0x0020, 0x0040
_PPM = 1 << 16  # freq is in ppm with a binary fraction of 16 bits


class State(IntEnum):
    """State that adjtimex returns."""

    OK = 0
    INSERT = 1  # a leap second is inserted at the end of this day
    DELETE = 2
    IN_LEAP_SECOND = 3
    AFTER_LEAP_SECOND = 4
    UNSYNCHRONISED = 5


class KernelClock(NamedTuple):
    """State of CLOCK_REALTIME.

    is_synchronised       as reported to the kernel by the program that steers the clock; chronyd needs `rtcsync`.
    leap                  1 or -1 if the kernel will insert or remove a second at the end of the UTC day, else 0.
    frequency_ppb         frequency correction that the kernel applies.
    estimated_error_ns, maximum_error_ns  as reported to the kernel; they grow by 500 ppm since.
    tai_offset_s          TAI minus UTC; None if never set (CLOCK_TAI then equals UTC).
    """

    state: State
    is_synchronised: bool
    leap: int
    frequency_ppb: float
    estimated_error_ns: int
    maximum_error_ns: int
    tai_offset_s: int | None

    @property
    def uncertainty_ns(self) -> int | None:
        """Bound of the clock's error, from the program that steers it; None if it is not synchronised."""
        return self.maximum_error_ns if self.is_synchronised else None


def kernel_clock() -> KernelClock:
    """Return the current state. Raises InterfaceError if adjtimex fails."""
    timex = ctypes.create_string_buffer(TIMEX.size)  # zeros: modes 0 changes nothing
    state = _adjtimex()(timex)
    if state < 0:
        raise InterfaceError(f"adjtimex: errno {ctypes.get_errno()}")
    return parsed(state, timex.raw)


@cache
def _adjtimex() -> Any:
    """Return the C function; it is cached, because it is called each second."""
    return ctypes.CDLL(None, use_errno=True).adjtimex


def parsed(state: int, octets: bytes) -> KernelClock:
    """Decode a struct timex. state: return value of adjtimex."""
    _, _, frequency, maximum_us, estimated_us, status, *_, tai = TIMEX.unpack(octets)
    return KernelClock(
        State(state),
        state != State.UNSYNCHRONISED and not status & STA_UNSYNC,
        (status & STA_INS != 0) - (status & STA_DEL != 0),
        frequency * 1000 / _PPM,
        estimated_us * 1000,
        maximum_us * 1000,
        tai or None,
    )
