"""PPS_FETCH and its like: what Linux makes of RFC 2783, octet by octet. Source: linux/pps.h, drivers/pps/pps.c."""

import os
import struct
import sys
from collections.abc import Callable
from typing import Literal, NamedTuple

# Mode bits of linux/pps.h.
CANWAIT = 0x100
Edge = Literal["assert", "clear"]
CAPTURES = {"assert": 0x01, "clear": 0x02}

POINTER = struct.calcsize("P")


def layout(pointer: int, machine: str) -> str:
    """How struct pps_fdata is aligned: as the compiler does it, 64 octets, or 60 on i386. Kernels of 64 bits take every
    program of 32 bits for one of i386, those of a 32-bit Raspberry Pi OS as well.

    Source: pps_cdev_compat_ioctl() in drivers/pps/pps.c.
    """
    return "=" if pointer == 4 and machine in {"aarch64", "armv8l", "x86_64"} else "@"


# struct pps_kparams: version; mode; offsets of assert and of clear (s, ns, flags). struct pps_fdata: sequence of assert
# and of clear; time of assert and of clear (s, ns, flags); mode, which is 0 before the first edge; time-out.
KPARAMS = struct.Struct("@iiqiIqiI")
FDATA = struct.Struct(layout(POINTER, os.uname().machine) + "IIqiIqiIiqiI")

# As fcntl.ioctl(): descriptor, number, octets that the kernel reads and writes. Raises OSError.
Ioctl = Callable[[int, int, bytearray], object]


def number(direction: int, which: int, pointer: int = POINTER) -> int:
    """An ioctl of linux/pps.h; direction 2 for what the kernel writes, 1 for what it reads, 3 for both.

    Its size is that of a pointer, since the macros name `struct pps_fdata *`: 32-bit programs have other numbers.
    """
    return direction << 30 | pointer << 16 | ord("p") << 8 | which


PPS_GETPARAMS = number(2, 0xA1)
PPS_GETCAP = number(2, 0xA3)
PPS_FETCH = number(3, 0xA4)


class Fetched(NamedTuple):
    """What PPS_FETCH tells: of each edge how many there were, and when the last was by the system's clock."""

    sequences: dict[Edge, int]
    stamps_ns: dict[Edge, int]


def fetch(ioctl: Ioctl, device: int, wait_ns: int) -> Fetched:
    """Wait for the next edge, of whichever kind the device captures; for 0 ns: what the last ones were.

    Raises TimeoutError when none came, InterruptedError at a signal, OSError.
    """
    octets = bytearray(FDATA.pack(*[0] * 9, *divmod(wait_ns, 10**9), 0))
    ioctl(device, PPS_FETCH, octets)
    asserts, clears, assert_s, assert_ns, _, clear_s, clear_ns, *_ = FDATA.unpack(octets)
    return Fetched(
        {"assert": asserts, "clear": clears},
        {"assert": assert_s * 10**9 + assert_ns, "clear": clear_s * 10**9 + clear_ns},
    )


def modes(ioctl: Ioctl, device: int) -> tuple[int, int]:
    """Mode bits of what a device can do, and of what it does. Raises OSError."""
    can, does = bytearray(4), bytearray(KPARAMS.size)
    ioctl(device, PPS_GETCAP, can)
    ioctl(device, PPS_GETPARAMS, does)
    return int.from_bytes(can, sys.byteorder), KPARAMS.unpack(does)[1]
