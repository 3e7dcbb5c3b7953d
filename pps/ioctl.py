"""PPS_FETCH and other ioctls of RFC 2783. Source: linux/pps.h, drivers/pps/pps.c."""

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
    """Return the alignment of struct pps_fdata for struct: the compiler's, with 64 octets, or 60 octets on i386.

    Kernels of 64 bits treat each 32-bit program as one of i386, even those of a 32-bit Raspberry Pi OS.
    Source: pps_cdev_compat_ioctl() in drivers/pps/pps.c.
    """
    return "=" if pointer == 4 and machine in {"aarch64", "armv8l", "x86_64"} else "@"


# struct pps_kparams: version; mode; offsets of assert and clear (s, ns, flags). struct pps_fdata: sequences of assert
# and clear; times of assert and clear (s, ns, flags); mode, which is 0 before the first edge; timeout.
KPARAMS = struct.Struct("@iiqiIqiI")
FDATA = struct.Struct(layout(POINTER, os.uname().machine) + "IIqiIqiIiqiI")

# Like fcntl.ioctl(): descriptor, number, buffer that the kernel reads and writes. Raises OSError.
Ioctl = Callable[[int, int, bytearray], object]


def number(direction: int, which: int, pointer: int = POINTER) -> int:
    """Return the number of an ioctl of linux/pps.h. direction: 2 if the kernel writes, 1 if it reads, 3 for both.

    The size in it is that of a pointer, because the macros name `struct pps_fdata *`; 32-bit programs have other
    numbers.
    """
    return direction << 30 | pointer << 16 | ord("p") << 8 | which


PPS_GETPARAMS = number(2, 0xA1)
PPS_GETCAP = number(2, 0xA3)
PPS_FETCH = number(3, 0xA4)


class Fetched(NamedTuple):
    """Result of PPS_FETCH: by edge, the number of edges so far, and the last one's time by the system's clock."""

    sequences: dict[Edge, int]
    stamps_ns: dict[Edge, int]


def fetch(ioctl: Ioctl, device: int, wait_ns: int) -> Fetched:
    """Wait for the next edge of any captured kind; with 0 ns, return the last edges at once.

    Raises TimeoutError if no edge came, InterruptedError at a signal, OSError for other errors.
    """
    octets = bytearray(FDATA.pack(*[0] * 9, *divmod(wait_ns, 10**9), 0))
    ioctl(device, PPS_FETCH, octets)
    asserts, clears, assert_s, assert_ns, _, clear_s, clear_ns, *_ = FDATA.unpack(octets)
    return Fetched(
        {"assert": asserts, "clear": clears},
        {"assert": assert_s * 10**9 + assert_ns, "clear": clear_s * 10**9 + clear_ns},
    )


def modes(ioctl: Ioctl, device: int) -> tuple[int, int]:
    """Return the mode bits that a device supports, and those that are set. Raises OSError if the kernel refuses."""
    can, does = bytearray(4), bytearray(KPARAMS.size)
    ioctl(device, PPS_GETCAP, can)
    ioctl(device, PPS_GETPARAMS, does)
    return int.from_bytes(can, sys.byteorder), KPARAMS.unpack(does)[1]
