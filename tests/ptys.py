"""Octets under way in ptys, which a thread of the kernel carries, and a clock that waits for them before it jumps."""

import fcntl
import os
import struct
from collections import Counter
from typing import Any

import pytest

from tests.virtual import VirtualLoop

PORT_NUMBER = 0x8004_5430  # TIOCGPTN of linux/tty.h: which port a simulator's end belongs to


class Ptys:
    """What was written by one end and not yet read at the other, by the number of the pty.

    What this process does with ttys goes through here. What is said to a port that nobody has open goes nowhere, and
    what is on its way when a port is closed is lost.
    """

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self._under_way: Counter[tuple[int, bool]] = Counter()  # number, whether by the station
        self._ports: dict[int, int] = {}  # those of the station: descriptor -> number
        self._write, self._read, self._open, self._close = os.write, os.read, os.open, os.close
        for name in ("write", "read", "open", "close"):
            patch.setattr(os, name, getattr(self, name))

    def is_carrying(self) -> bool:
        return any(self._under_way.values())

    def forget(self) -> None:
        """What was under way has not come, and will not."""
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
        """Of the pty that an end belongs to, where the station has its port open."""
        if descriptor in self._ports:
            return self._ports[descriptor]
        try:
            (number,) = struct.unpack("I", fcntl.ioctl(descriptor, PORT_NUMBER, bytes(4)))
        except OSError:
            return None
        return number if number in self._ports.values() else None


class PtyLoop(VirtualLoop):
    """Lets what is under way in ptys arrive before its clock jumps; what does not within CARRY_S is lost."""

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
