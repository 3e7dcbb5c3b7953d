"""The other end of a console: a pty, behind it a VT100 or what takes octets as they come; and a station's socket."""

import contextlib
import fcntl
import os
import re
import struct
import termios
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyte

from firmware.console.console import Console, Options
from firmware.endpoint.control.control_socket import ControlSocket
from firmware.endpoint.control.question import Commands
from tests.virtual import VirtualLoop

# All that a console may send: printable ASCII, ends of lines, and the three of ECMA-48 that each VT100 has.
ALLOWED = re.compile(rb"(?:[\x20-\x7e\r\n]|\x1b\[[HKJ])*")
PRINTED = re.compile(rb"[\x20-\x7e\r\n]*")


class Counted:
    """The module os as a Terminal uses it: counts what it has read and written."""

    def __init__(self) -> None:
        self.octets_read = 0
        self.octets_written = 0

    def __getattr__(self, name: str) -> Any:
        return getattr(os, name)

    def read(self, descriptor: int, most: int) -> bytes:
        octets = os.read(descriptor, most)
        self.octets_read += len(octets)
        return octets

    def write(self, descriptor: int, octets: bytes) -> int:
        taken = os.write(descriptor, octets)
        self.octets_written += taken
        return taken


class Emulated:
    """A terminal at the other end of a pty: reads while it is not stopped, and shows what it has read.

    sent  octets since somebody has emptied it.
    ours  counts at the console's end.
    """

    def __init__(self, loop: VirtualLoop, columns: int = 80, lines: int = 24) -> None:
        self.sent = b""
        self.ours = Counted()
        self._octets_read = 0
        self._octets_typed = 0
        self.loop = loop
        self.screen = pyte.Screen(columns, lines)
        self._stream = pyte.ByteStream(self.screen)
        self.master, self.slave = os.openpty()
        os.set_blocking(self.master, False)
        self.is_reading = False
        self.resize(columns, lines)
        self.go_on()

    def fileno(self) -> int:
        return self.master

    def ready(self, events: int) -> None:
        try:
            octets = os.read(self.master, 4096)
        except OSError:
            octets = b""
        if not octets:
            self.stop()
        self.sent += octets
        self._octets_read += len(octets)
        self._stream.feed(octets)

    @property
    def is_carrying(self) -> bool:
        """Whether the kernel has octets that one end wrote and the other has not read: a thread of its passes them."""
        if self.master < 0:
            return False
        is_sent = self.is_reading and self._octets_read < self.ours.octets_written
        return is_sent or self.ours.octets_read < self._octets_typed

    def go_on(self) -> None:
        if not self.is_reading:
            self.is_reading = True
            self.loop.add(self)

    def stop(self) -> None:
        """Read nothing more: a cable that is cut, a terminal that is stopped."""
        if self.is_reading:
            self.is_reading = False
            self.loop.remove(self)

    def fill(self) -> None:
        """Write from the console's end until nothing more is taken."""
        descriptor = os.open(os.ttyname(self.slave), os.O_WRONLY | os.O_NONBLOCK | os.O_NOCTTY)
        with contextlib.suppress(BlockingIOError):
            while True:
                self.ours.write(descriptor, b"\r" * 100)
        os.close(descriptor)

    def resize(self, columns: int, lines: int) -> None:
        self.screen.resize(lines, columns)
        fcntl.ioctl(self.master, termios.TIOCSWINSZ, struct.pack("4H", lines, columns, 0, 0))

    def type(self, octets: bytes) -> None:
        assert os.write(self.master, octets) == len(octets)
        self._octets_typed += len(octets) - octets.count(b"\x11") - octets.count(b"\x13")  # which the kernel keeps

    @property
    def lines(self) -> list[str]:
        return [line.rstrip() for line in self.screen.display]

    @property
    def text(self) -> str:
        return "\n".join(self.lines)

    def shows(self, words: str) -> Callable[[], bool]:
        return lambda: words in self.text

    def hang_up(self) -> None:
        self.stop()
        if self.master >= 0:
            os.close(self.master)
            self.master = -1

    def close(self) -> None:
        self.hang_up()
        os.close(self.slave)


class Bench:
    """A console at an emulated terminal, and a station, on one virtual loop.

    status  what the station says; asked: how often it was asked.
    """

    def __init__(self, loop: VirtualLoop, folder: Path, status: dict[str, Any]) -> None:
        self.loop = loop
        self.status = status
        self.asked: list[float] = []
        self.path = str(folder / "captain-5555.sock")
        self.notes = folder / "notes"
        self.terminal = Emulated(loop)
        loop.is_carrying = lambda: self.terminal.is_carrying
        self.console: Console | None = None
        self.is_over = False
        self._station: ControlSocket | None = None

    def open(self, **options: Any) -> None:
        made = Options(**{"control": [self.path], "notes": str(self.notes)} | options)
        self.console = Console(self.loop, self.terminal.slave, made)
        self.loop.stop = self._stop  # type: ignore[method-assign]
        self.console.start()

    def start_station(self) -> None:
        self._station = ControlSocket(self.loop, self.path, Commands({"status": self._told}))

    def stop_station(self) -> None:
        if self._station is not None:
            self._station.close()
            self._station = None

    def until(self, is_so: Callable[[], bool], within: float = 60.0) -> None:
        self.loop.run_until(is_so, within)

    def until_shown(self, words: str, within: float = 60.0) -> None:
        try:
            self.loop.run_until(self.terminal.shows(words), within)
        except AssertionError as error:
            raise AssertionError(f"{words!r} is not shown:\n{self.terminal.text}") from error

    def until_gone(self, words: str, within: float = 60.0) -> None:
        self.loop.run_until(lambda: words not in self.terminal.text, within)

    def until_silent(self) -> None:
        """Until nothing has come for ten seconds, in which five looks would have changed something."""
        for _ in range(20):
            self.terminal.sent = b""
            self.loop.run_for(10.0)
            if not self.terminal.sent:
                return
        raise AssertionError("it goes on")

    def press(self, keys: bytes) -> None:
        self.terminal.type(keys)

    def close(self) -> None:
        if self.console is not None:
            self.console.close()
        self.stop_station()
        self.terminal.close()

    def _told(self, question: object) -> dict[str, object]:
        self.asked.append(self.loop.now)
        return {"status": self.status}

    def _stop(self) -> None:
        self.is_over = True
