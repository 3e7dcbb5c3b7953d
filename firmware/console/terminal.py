"""Terminal on the loop: keys as they arrive, frames without blocking."""

import fcntl
import os
import struct
import termios
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from board.runtime.errors import InterfaceError
from board.runtime.loop import READ, WRITE, Loop

COLUMNS, LINES = 80, 24  # default, because a serial line cannot report its size
RATE = 10_000  # octets per second; a line of 115200 baud carries 11,520
STOPPED_S = 1.0
BATCH = 4096  # most octets read in one turn; the queue of a tty holds no more

Modes = list[Any]  # result of termios.tcgetattr()
IFLAG, OFLAG, _, LFLAG, _, _, CC = range(7)
# Bits of IFLAG whose change reinitialises the line, unless its driver does XON and XOFF itself. Drivers of a Pi do not
# (uart_set_termios of Linux' serial_core.c). The reinitialisation corrupts output in progress, and silences QEMU's mini
# UART. So these bits stay unchanged, except BRKINT, which turns a break into a signal. A pulled plug must cause noise
# at most.
SET_UP = termios.IGNBRK | termios.BRKINT | termios.IGNPAR | termios.PARMRK | termios.INPCK


class Terminal:
    """Terminal of a descriptor; it has modes of its own until it is closed.

    typed  called with received octets.
    gone   called once when it has hung up.

    Raises InterfaceError if the descriptor is not a terminal.
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
            raise InterfaceError(
                "standard input is not a terminal", "`captain console --once` prints one screen"
            ) from error
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
        """Usable columns and lines; the last column is left out, because some terminals wrap after it."""
        try:
            lines, columns, _, _ = struct.unpack("4H", fcntl.ioctl(self._descriptor, termios.TIOCGWINSZ, bytes(8)))
        except OSError:
            lines = columns = 0
        return max(1, min(columns or COLUMNS, COLUMNS) - 1), max(1, min(lines or LINES, LINES) - 1)

    @property
    def is_free(self) -> bool:
        """True if all output has been sent; false while the peer has stopped it (XOFF), or the line is slow."""
        return self._is_served and not self._waiting and self._loop.clock() >= self._free_at and not self._queued()

    @property
    def is_stopped(self) -> bool:
        """True if the last frame should have been sent STOPPED_S ago, so a retry soon would fail too."""
        return not self.is_free and self._loop.clock() > self._free_at + STOPPED_S

    def draw(self, octets: bytes) -> None:
        """Write a frame while is_free; the part that the terminal does not take at once waits."""
        assert not self._waiting
        self._free_at = self._loop.clock() + len(octets) / RATE
        self._write(octets)

    def say(self, octets: bytes) -> None:
        """Write a few octets at once or not at all, before the terminal is lent."""
        if self._is_served and not self._waiting:
            with suppress(OSError):
                os.write(self._descriptor, octets)

    def lend(self) -> None:
        """Lend the terminal to a child, with its previous modes."""
        if self._is_served:
            self._is_served = False
            self._waiting = b""
            self._loop.remove(self)
            os.set_blocking(self.given, True)
            self._set(self._before)

    def take(self) -> None:
        """Take the terminal: keys arrive singly without echo or signals, and earlier input is discarded."""
        os.set_blocking(self._descriptor, False)
        self._set(_single_keys(self._before))
        with suppress(termios.error):
            termios.tcflush(self._descriptor, termios.TCIFLUSH)
        self._is_served = True
        self._loop.add(self)

    def close(self) -> None:
        """Give the terminal back without waiting for a stopped line; idempotent."""
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
            self._set(self._before)  # the borrower may have changed them
        os.close(self._descriptor)
        self._descriptor = -1

    def _read(self) -> None:
        try:
            octets = os.read(self._descriptor, BATCH)
        except BlockingIOError:
            return
        except OSError:  # EIO: the terminal has hung up
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
        """Return the number of octets that the kernel has not sent yet."""
        try:
            return int(struct.unpack("i", fcntl.ioctl(self._descriptor, termios.TIOCOUTQ, bytes(4)))[0])
        except OSError:
            return 0

    def _set(self, modes: Modes) -> None:
        with suppress(termios.error):  # the terminal has hung up: the next read reports it
            termios.tcsetattr(self._descriptor, termios.TCSANOW, modes)


def _opened(descriptor: int) -> int:
    """Open the same terminal again, so that O_NONBLOCK does not affect other users such as the caller's shell.

    If it cannot be opened, because it belongs to another user, duplicate the descriptor.
    """
    try:
        return os.open(os.ttyname(descriptor), os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError:
        return os.dup(descriptor)


def _single_keys(modes: Modes) -> Modes:
    """Return modes in which octets arrive unchanged, and the line handles only XOFF and XON; any key acts as XON.

    Otherwise an XOFF in noise would stop the screen permanently.
    """
    made = list(modes)
    made[IFLAG] = modes[IFLAG] & SET_UP & ~termios.BRKINT | termios.IXON | termios.IXANY
    made[OFLAG] &= ~termios.OPOST
    made[LFLAG] &= ~(termios.ICANON | termios.ECHO | termios.ECHONL | termios.ISIG | termios.IEXTEN)
    made[CC] = list(modes[CC])
    made[CC][termios.VMIN], made[CC][termios.VTIME] = 1, 0
    return made
