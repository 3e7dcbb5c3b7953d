"""The kernel's own word of its clock, by adjtimex(2) without rights: where nobody else says how good it is."""

import ctypes
import struct
from enum import IntEnum
from functools import cache
from typing import Any, NamedTuple

from board.errors import InterfaceError

# struct timex of <sys/timex.h>: modes; offset, freq, maxerror, esterror; status; constant, precision, tolerance;
# time (2); tick, ppsfreq, jitter; shift; stabil, jitcnt, calcnt, errcnt, stbcnt; tai; eleven spare ints.
TIMEX = struct.Struct("@I4li3l2l3li5li44x")

STA_INS, STA_DEL, STA_UNSYNC = 0x0010, 0x0020, 0x0040
_PPM = 1 << 16  # freq is ppm with 16 bits of fraction


class State(IntEnum):
    """What adjtimex returns."""

    OK = 0
    INSERT = 1  # a leap second at the end of this day
    DELETE = 2
    IN_LEAP_SECOND = 3
    AFTER_LEAP_SECOND = 4
    UNSYNCHRONISED = 5


class KernelClock(NamedTuple):
    """The state of CLOCK_REALTIME.

    is_synchronised       as whoever steers it has told the kernel; chronyd does so with `rtcsync` only.
    leap                  1 or -1 where the kernel will insert or leave out a second at the end of the UTC day.
    frequency_ppb         that the kernel corrects by.
    estimated_error_ns, maximum_error_ns  as told, and growing by 500 ppm since.
    tai_offset_s          TAI less UTC; None where nobody has told it (CLOCK_TAI is UTC then).
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
        """Bound of the clock's error, by whoever steers it; None where nobody does."""
        return self.maximum_error_ns if self.is_synchronised else None


def kernel_clock() -> KernelClock:
    """The state of now. Raises InterfaceError where the system does not tell."""
    timex = ctypes.create_string_buffer(TIMEX.size)  # zeros: modes 0 changes nothing
    state = _adjtimex()(timex)
    if state < 0:
        raise InterfaceError(f"adjtimex: errno {ctypes.get_errno()}")
    return parsed(state, timex.raw)


@cache
def _adjtimex() -> Any:
    """Made once: it is asked each second."""
    return ctypes.CDLL(None, use_errno=True).adjtimex


def parsed(state: int, octets: bytes) -> KernelClock:
    """What a struct timex says. state: what adjtimex has returned with it."""
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
