"""Plays drivers/pps/pps.c of Linux behind fcntl.ioctl: counts edges, and answers in the kernel's own octets."""

import errno
import os
import struct
import threading

CAPTUREASSERT, CAPTURECLEAR, CANWAIT = 0x01, 0x02, 0x100
GPIO = 0x1151  # what pps-gpio can: capture and offset of assert, echo, wait, timespec
# Written down here once more, and compared with linux/pps.h: pps_fdata of a 64-bit kernel.
FDATA = struct.Struct("<IIqiIqiIi4xqiI")
KPARAMS = struct.Struct("<iiqiIqiI")
GETPARAMS, GETCAP, FETCH = 0x800870A1, 0x800870A3, 0xC00870A4

PATIENCE_S = 20.0  # bounds a failure


class Kernel:
    """A PPS device. As a callable it is its ioctl, which waits as the kernel's does, until something is done here.

    waits_ns  time-outs of all PPS_FETCH so far.
    """

    def __init__(self, can=GPIO, does=CAPTUREASSERT):
        self.can, self.does = can, does
        self.sequences = [0, 0]
        self.stamps_ns = [0, 0]
        self.waits_ns = []
        self._mode = 0  # nothing is to be had before the first edge
        self._changed = threading.Condition()
        self._events = 0
        self._errors = []
        self._sitting = 0

    def pulse(self, stamp_ns, which=0, count=1):
        """Edges: 0 for assert, 1 for clear; of several only the last has a stamp."""
        with self._changed:
            self.sequences[which] = (self.sequences[which] + count) % 2**32
            self.stamps_ns[which] = stamp_ns
            self._mode = self.does
            self._events += 1
            self._sitting = 0
            self._changed.notify_all()

    def fail(self, number, times=1):
        """The call that waits, or the next that does, ends so: by an errno, or another exception."""
        with self._changed:
            self._errors += [OSError(number, os.strerror(number)) if isinstance(number, int) else number] * times
            self._changed.notify_all()

    def recover(self):
        """Nothing fails any more."""
        with self._changed:
            self._errors.clear()

    def expire(self):
        """A whole time-out goes by."""
        self.wait()
        self.fail(errno.ETIMEDOUT)

    def wait(self):
        """Until somebody waits for an edge, and nothing is there that would end it."""
        with self._changed:
            assert self._changed.wait_for(lambda: self._sitting and not self._errors, PATIENCE_S), "nobody waits"

    def __call__(self, device, number, octets):
        with self._changed:
            if number == GETCAP:
                octets[:] = struct.pack("<i", self.can)
            elif number == GETPARAMS:
                octets[:] = KPARAMS.pack(1, self.does, 0, 0, 0, 0, 0, 0)
            elif number == FETCH:
                self._fetch(octets)
            else:
                raise OSError(errno.ENOTTY, os.strerror(errno.ENOTTY))
        return 0

    def _fetch(self, octets):
        *_, wait_s, wait_ns, flags = FDATA.unpack(octets)
        assert not flags
        self.waits_ns.append(wait_s * 10**9 + wait_ns)
        if self.waits_ns[-1]:
            before = self._events
            self._sitting += 1
            self._changed.notify_all()
            assert self._changed.wait_for(lambda: self._events != before or self._errors, PATIENCE_S)
            if self._events == before:
                self._sitting -= 1
                raise self._errors.pop(0)
        stamps = [part for stamp_ns in self.stamps_ns for part in (*divmod(stamp_ns, 10**9), 0)]
        octets[:] = FDATA.pack(*self.sequences, *stamps, self._mode, wait_s, wait_ns, flags)
