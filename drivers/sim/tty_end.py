"""The module's own end of a tty that an interface opens: a pty, or the tty of a USB gadget."""

import os
import pty
import termios
import tty
from collections.abc import Callable
from contextlib import suppress

from board.loop import READ, WRITE, Loop, Timer

BATCH = 4096
REOPEN_S = 1.0  # between two tries to open the tty of a gadget whose host has gone


class TtyEnd:
    """Octets in by a call; octets out as somebody reads.

    path  that an interface opens; empty while there is none.
    """

    def __init__(
        self, loop: Loop, heard: Callable[[bytes], None], gadget: str = "", kept: int = 0, reads: bool = True
    ) -> None:
        """Opens nothing.

        heard   is given what comes in.
        gadget  path of the tty that is used in place of a pty: /dev/ttyGS0, whose far end the kernel has as ttyACM0.
        kept    octets that wait for who does not read; what is said beyond is lost.
        reads   False: it takes nothing from the line, which is full some 4 KiB later.
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
        """Rate that whoever has opened a pty has set, one of termios."""
        return int(termios.tcgetattr(self._far)[5])

    def open(self) -> None:
        """Appear; the path of a pty is another one each time. A gadget's tty is opened as soon as it is there."""
        if self._is_wanted:
            return
        self._is_wanted = True
        if self._gadget:
            self._open_gadget()
            return
        # The far end stays open: a pty whose far end nobody has open reports a hang-up.
        self._end, self._far = pty.openpty()
        tty.setraw(self._far)
        os.set_blocking(self._end, False)
        self._opened(os.ttyname(self._far))

    def close(self) -> None:
        """Disappear, with what was not read; idempotent."""
        self._is_wanted = False
        self._waiting = b""
        if self._timer is not None:
            self._timer.cancel()
        self._shut()

    def say(self, octets: bytes) -> None:
        """Send, as far as the line takes it now, the rest as it empties."""
        if not self._is_wanted:
            return
        self._waiting += octets
        self._write()
        self._waiting = self._waiting[: self._kept]
        self._want()

    def listen(self) -> None:
        """Read from now on."""
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
        except OSError:  # of a gadget: its host has gone
            octets = b""
        if octets:
            self._heard(octets)
        else:
            self._shut()
            self._timer = self._loop.after(REOPEN_S, self._open_gadget)

    def _write(self) -> None:
        if self.is_open:
            with suppress(OSError):  # full, or the host of a gadget has gone: reading tells
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
