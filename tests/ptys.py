"""Ptys in tests: counts octets in transit, so that virtual time waits for them."""

import fcntl
import os
import struct
from collections import Counter
from typing import Any

import pytest

from tests.virtual import VirtualLoop

PORT_NUMBER = 0x8004_5430  # ioctl TIOCGPTN of linux/tty.h: returns the number of the pty of a simulator's end


class Ptys:
    """Counters of the octets that one end of a pty has written and the other has not read yet.

    A thread of the kernel carries these octets. The functions of `os` for files are patched, so that all accesses of
    this process to ttys are counted. Octets to a port that is not open do not count, and closing a port resets its
    counts, because the octets are lost.
    """

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self._under_way: Counter[tuple[int, bool]] = Counter()  # by pty, and True if the station wrote
        self._ports: dict[int, int] = {}  # numbers of the ptys that the station has open, by descriptor
        self._write, self._read, self._open, self._close = os.write, os.read, os.open, os.close
        for name in ("write", "read", "open", "close"):
            patch.setattr(os, name, getattr(self, name))

    def is_carrying(self) -> bool:
        return any(self._under_way.values())

    def forget(self) -> None:
        """Reset the counts: octets that have not arrived by now are lost."""
        self._under_way.clear()

    def open(self, path: Any, *how: Any, **more: Any) -> int:
        descriptor = self._open(path, *how, **more)
        if os.isatty(descriptor):
            self._ports[descriptor] = int(os.ttyname(descriptor).rpartition("/")[2])
        return descriptor

    def close(self, descriptor: int) -> None:
        if (number := self._number(descriptor)) is not None:
            self._under_way[number, True] = self._under_way[number, False] = 0
        self._ports.pop(descriptor, None)
        self._close(descriptor)

    def write(self, descriptor: int, octets: bytes) -> int:
        written = self._write(descriptor, octets)
        if (number := self._number(descriptor)) is not None:
            self._under_way[number, descriptor in self._ports] += written
        return written

    def read(self, descriptor: int, size: int) -> bytes:
        octets = self._read(descriptor, size)
        if (number := self._number(descriptor)) is not None:
            way = number, descriptor not in self._ports
            self._under_way[way] = max(0, self._under_way[way] - len(octets))
        return octets

    def _number(self, descriptor: int) -> int | None:
        """Return the number of the pty to which a descriptor belongs; None unless the station has its port open."""
        if descriptor in self._ports:
            return self._ports[descriptor]
        try:
            (number,) = struct.unpack("I", fcntl.ioctl(descriptor, PORT_NUMBER, bytes(4)))
        except OSError:
            return None
        return number if number in self._ports.values() else None


class PtyLoop(VirtualLoop):
    """Virtual loop whose clock jumps only after octets in ptys have arrived; after CARRY_S they count as lost."""

    def __init__(self, ptys: Ptys, patience_s: float = 0.0) -> None:
        super().__init__(patience_s=patience_s)
        self.ptys = ptys
        self.is_carrying = ptys.is_carrying

    def _wait(self) -> list[tuple[int, int]]:
        before = self.now
        ready = super()._wait()
        if self.now != before:
            self.ptys.forget()
        return ready
