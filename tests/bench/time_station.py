"""`captain` with a PPS device whose kernel is simulated.

usage: python -m tests.bench.time_station WORDS...     as captain WORDS...
"""

import errno
import os
import struct
import sys
import time

from firmware.__main__ import main
from pps import ioctl
from pps.device import PulseDevice

CAN = 0x1151  # what pps-gpio can: capture and offset of assert, echo, wait, timespec
ASSERT = 0x01
LATE_NS = 6_000  # of each stamp, as the station assumes


def played(device: int, number: int, octets: bytearray) -> int:
    """fcntl.ioctl() of a PPS device."""
    if number == ioctl.PPS_GETCAP:
        octets[:] = struct.pack("@i", CAN)
    elif number == ioctl.PPS_GETPARAMS:
        octets[:] = ioctl.KPARAMS.pack(1, ASSERT, 0, 0, 0, 0, 0, 0)
    elif number == ioctl.PPS_FETCH:
        *_, wait_s, wait_ns, _ = ioctl.FDATA.unpack(octets)
        edge_s = time.time_ns() // 10**9
        if wait_s or wait_ns:
            edge_s += 1
            time.sleep(max(0, edge_s * 10**9 + LATE_NS - time.time_ns()) / 1e9)
        octets[:] = ioctl.FDATA.pack(edge_s % 2**32, 0, edge_s, LATE_NS, 0, 0, 0, 0, ASSERT, wait_s, wait_ns, 0)
    else:
        raise OSError(errno.ENOTTY, os.strerror(errno.ENOTTY))
    return 0


if __name__ == "__main__":
    assert PulseDevice.__init__.__kwdefaults__ is not None
    PulseDevice.__init__.__kwdefaults__["ioctl"] = played
    sys.exit(main())
