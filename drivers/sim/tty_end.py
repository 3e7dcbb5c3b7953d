"""Module's end of a tty that an interface opens: a pty, or the tty of a USB gadget."""

import os
import pty
import termios
import tty
from collections.abc import Callable
from contextlib import suppress

from board.runtime.loop import READ, WRITE, Loop, Timer

BATCH = 4096
REOPEN_S = 1.0  # interval of attempts to open the tty of a gadget whose host has gone


class TtyEnd:
    """Module's end of a tty: passes received octets to a callback, and sends octets when the reader takes them.

    path  path that an interface opens; empty while closed.
    """

    def __init__(
        self, loop: Loop, heard: Callable[[bytes], None], gadget: str = "", kept: int = 0, reads: bool = True
    ) -> None:
        """Store the settings; open() opens the tty.

        heard   called with received octets.
        gadget  path of a tty in place of a pty: /dev/ttyGS0, whose far end the kernel has as ttyACM0.
        kept    octets that are kept for a reader that does not read; further octets are lost.
        reads   False: it does not read the line, which is full after about 4 KiB.
        """
        self.path = ""
        self._loop = loop
        self._heard = heard
        self._gadget = gadget
        self._kept = kept
        self._reads = reads
        self._waiting = b""
        self._is_wanted = False
        self._end = self._far = -1
        self._timer: Timer | None = None

    @property
    def is_open(self) -> bool:
        return self._end >= 0

    @property
    def speed(self) -> int:
        """Baud rate that the program at the far end of the pty has set, as a constant of termios."""
        return int(termios.tcgetattr(self._far)[5])

    def open(self) -> None:
        """Create the tty. A pty has another path each time. A gadget's tty is opened as soon as it exists."""
        if self._is_wanted:
            return
        self._is_wanted = True
        if self._gadget:
            self._open_gadget()
            return
        # The far end stays open here, because a pty with a closed far end reports a hang-up.
        self._end, self._far = pty.openpty()
        tty.setraw(self._far)
        os.set_blocking(self._end, False)
        self._opened(os.ttyname(self._far))

    def close(self) -> None:
        """Close the tty and discard unread octets; idempotent."""
        self._is_wanted = False
        self._waiting = b""
        if self._timer is not None:
            self._timer.cancel()
        self._shut()

    def say(self, octets: bytes) -> None:
        """Send octets: at once as many as the line takes, the rest when it can take more."""
        if not self._is_wanted:
            return
        self._waiting += octets
        self._write()
        self._waiting = self._waiting[: self._kept]
        self._want()

    def listen(self) -> None:
        """Start to read the line."""
        self._reads = True
        self._want()

    def fileno(self) -> int:
        return self._end

    def ready(self, events: int) -> None:
        if events & WRITE:
            self._write()
            self._want()
        if events & ~WRITE:
            self._read()

    def _read(self) -> None:
        try:
            octets = os.read(self._end, BATCH)
        except BlockingIOError:
            return
        except OSError:  # the host of a gadget has gone
            octets = b""
        if octets:
            self._heard(octets)
        else:
            self._shut()
            self._timer = self._loop.after(REOPEN_S, self._open_gadget)

    def _write(self) -> None:
        if self.is_open:
            with suppress(OSError):  # the line is full, or the host of a gadget has gone, which reading detects
                self._waiting = self._waiting[os.write(self._end, self._waiting) :]

    def _want(self) -> None:
        if self.is_open:
            self._loop.want(self, (READ if self._reads else 0) | (WRITE if self._waiting else 0))

    def _open_gadget(self) -> None:
        try:
            self._end = os.open(self._gadget, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
            tty.setraw(self._end)
        except (OSError, termios.error):
            self._shut()
            self._timer = self._loop.after(REOPEN_S, self._open_gadget)
            return
        self._opened(self._gadget)

    def _opened(self, path: str) -> None:
        self.path = path
        self._loop.add(self)
        self._want()

    def _shut(self) -> None:
        if self.is_open:
            self._loop.remove(self)
        for descriptor in {self._end, self._far} - {-1}:
            os.close(descriptor)
        self._end = self._far = -1
        self.path = ""
