"""A terminal on the loop: octets come as they are typed, frames leave without waiting or not at all."""

import fcntl
import os
import struct
import termios
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from board.errors import InterfaceError
from board.loop import READ, WRITE, Loop

COLUMNS, LINES = 80, 24  # where the terminal does not say: a serial line cannot
RATE = 10_000  # octets a second: a line of 115200 baud carries 11,520
STOPPED_S = 1.0
BATCH = 4096  # octets read in a turn: a tty's queue holds no more

Modes = list[Any]  # of termios.tcgetattr()
IFLAG, OFLAG, _, LFLAG, _, _, CC = range(7)
# Of IFLAG what a line is set up anew for, by a driver that does XON and XOFF not itself, as those of a Pi
# (uart_set_termios of Linux' serial_core.c): that spoils what others have under way, and silences QEMU's mini UART. So
# it stays as it is, but for BRKINT, which makes a signal of a break; one of a plug that is pulled is noise at most.
SET_UP = termios.IGNBRK | termios.BRKINT | termios.IGNPAR | termios.PARMRK | termios.INPCK


class Terminal:
    """The terminal behind a descriptor, with modes of its own until it is closed.

    typed  is given what was typed.
    gone   is told once that it has hung up.
    Raises InterfaceError where there is no terminal.
    """

    def __init__(self, loop: Loop, descriptor: int, typed: Callable[[bytes], None], gone: Callable[[], None]) -> None:
        self.given = descriptor
        self._loop = loop
        self._typed = typed
        self._gone = gone
        self._waiting = b""
        self._free_at = 0.0
        self._is_served = False
        try:
            self._before: Modes = termios.tcgetattr(descriptor)
        except termios.error as error:
            raise InterfaceError("this is no terminal", "`captain console --once` prints one screen") from error
        self._descriptor = _opened(descriptor)
        self.take()

    def fileno(self) -> int:
        return self._descriptor

    def ready(self, events: int) -> None:
        if events & WRITE:
            self._write(self._waiting)
        if self._is_served and events & ~WRITE:
            self._read()

    @property
    def size(self) -> tuple[int, int]:
        """Columns and lines that may be written to: the last column would make some terminals go on to a new line."""
        try:
            lines, columns, _, _ = struct.unpack("4H", fcntl.ioctl(self._descriptor, termios.TIOCGWINSZ, bytes(8)))
        except OSError:
            lines = columns = 0
        return max(1, min(columns or COLUMNS, COLUMNS) - 1), max(1, min(lines or LINES, LINES) - 1)

    @property
    def is_free(self) -> bool:
        """Whether all that was drawn has left: not while the other end has stopped it (XOFF), or the line is slow."""
        return self._is_served and not self._waiting and self._loop.clock() >= self._free_at and not self._queued()

    @property
    def is_stopped(self) -> bool:
        """Whether it has not taken the last frame though it had the time: it will not do so within a moment either."""
        return not self.is_free and self._loop.clock() > self._free_at + STOPPED_S

    def draw(self, octets: bytes) -> None:
        """Write a frame, when it is free; what the terminal does not take at once waits, and no more than this."""
        assert not self._waiting
        self._free_at = self._loop.clock() + len(octets) / RATE
        self._write(octets)

    def say(self, octets: bytes) -> None:
        """Write a few octets at once, or not at all: before others have the terminal."""
        if self._is_served and not self._waiting:
            with suppress(OSError):
                os.write(self._descriptor, octets)

    def lend(self) -> None:
        """Leave it to a child, with the modes that it had before."""
        if self._is_served:
            self._is_served = False
            self._waiting = b""
            self._loop.remove(self)
            os.set_blocking(self.given, True)
            self._set(self._before)

    def take(self) -> None:
        """Have it, again: keys come one by one and are not shown, none is a signal, none is from before."""
        os.set_blocking(self._descriptor, False)
        self._set(_single_keys(self._before))
        with suppress(termios.error):
            termios.tcflush(self._descriptor, termios.TCIFLUSH)
        self._is_served = True
        self._loop.add(self)

    def close(self) -> None:
        """Give it back, without waiting for a line that is stopped; idempotent."""
        if self._descriptor < 0:
            return
        with suppress(OSError, termios.error):
            if self._waiting or self._queued():
                termios.tcflush(self._descriptor, termios.TCOFLUSH)
        if self._is_served:
            self.lend()
            with suppress(OSError):
                os.write(self._descriptor, b"\r\n")
        else:
            self._set(self._before)  # who had it lent may have changed them
        os.close(self._descriptor)
        self._descriptor = -1

    def _read(self) -> None:
        try:
            octets = os.read(self._descriptor, BATCH)
        except BlockingIOError:
            return
        except OSError:  # EIO: hung up
            octets = b""
        if octets:
            self._typed(octets)
        else:
            self._hung_up()

    def _write(self, octets: bytes) -> None:
        try:
            self._waiting = octets[os.write(self._descriptor, octets) :]
        except BlockingIOError:
            self._waiting = octets
        except OSError:
            self._hung_up()
            return
        self._loop.want(self, READ | WRITE if self._waiting else READ)

    def _hung_up(self) -> None:
        self.lend()
        self._gone()

    def _queued(self) -> int:
        """Octets that the kernel has still to send."""
        try:
            return int(struct.unpack("i", fcntl.ioctl(self._descriptor, termios.TIOCOUTQ, bytes(4)))[0])
        except OSError:
            return 0

    def _set(self, modes: Modes) -> None:
        with suppress(termios.error):  # it has hung up: the next read tells
            termios.tcsetattr(self._descriptor, termios.TCSANOW, modes)


def _opened(descriptor: int) -> int:
    """The same terminal, opened once more: one that does not wait must be nobody else's, the caller's shell above all.

    Where it cannot be opened, because it is another user's, it is the caller's all the same.
    """
    try:
        return os.open(os.ttyname(descriptor), os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError:
        return os.dup(descriptor)


def _single_keys(modes: Modes) -> Modes:
    """Modes in which octets come as they are, and only XOFF and XON are the line's own; any key is XON as well.

    An XOFF that is noise would stop the screen for ever.
    """
    made = list(modes)
    made[IFLAG] = modes[IFLAG] & SET_UP & ~termios.BRKINT | termios.IXON | termios.IXANY
    made[OFLAG] &= ~termios.OPOST
    made[LFLAG] &= ~(termios.ICANON | termios.ECHO | termios.ECHONL | termios.ISIG | termios.IEXTEN)
    made[CC] = list(modes[CC])
    made[CC][termios.VMIN], made[CC][termios.VTIME] = 1, 0
    return made
