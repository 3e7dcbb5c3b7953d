"""The port of a simulated receiver: a pty, with the rate of a UART where it is one; or the end of a USB gadget."""

import contextlib
import os
import pty
import termios
import tty
from collections.abc import Callable

from board.loop import READ, Loop, Timer

BATCH = 4096
REOPEN_S = 1.0  # between two tries to open the tty of a gadget whose host has gone


class ReceiverLine:
    """Octets in by a call; octets out as far as somebody reads: what the pty does not take is lost, as on a UART.

    baud    the receiver's own rate, None where it has none: what comes at another is not understood, and what is
            said arrives as garbage.
    gadget  path of the tty that is used in place of a pty: /dev/ttyGS0, whose far end the kernel has as ttyACM0.
    """

    def __init__(
        self, loop: Loop, heard: Callable[[bytes], None], baud: Callable[[], int | None], gadget: str = ""
    ) -> None:
        self.path = ""
        self._gadget = gadget
        self._loop = loop
        self._heard = heard
        self._baud = baud
        self._end = self._far = -1
        self._timer: Timer | None = None

    @property
    def is_open(self) -> bool:
        return self._end >= 0

    def fileno(self) -> int:
        return self._end

    def ready(self, events: int) -> None:
        try:
            octets = os.read(self._end, BATCH)
        except BlockingIOError:
            return
        except OSError:  # of a gadget: its host has gone
            octets = b""
        if not octets:
            self.close()
            self._timer = self._loop.after(REOPEN_S, self._open_gadget)
        elif self._is_at_rate():
            self._heard(octets)

    def open(self) -> None:
        """Appear; the path of a pty is another one each time."""
        if self._gadget:
            if self._timer is None:
                self._open_gadget()
            return
        # The far end stays open: a pty whose far end nobody has open reports a hang-up.
        self._end, self._far = pty.openpty()
        tty.setraw(self._far)
        os.set_blocking(self._end, False)
        self.path = os.ttyname(self._far)
        self._loop.add(self, READ)

    def close(self) -> None:
        """Disappear; idempotent."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if self.is_open:
            self._loop.remove(self)
            for descriptor in {self._end, self._far} - {-1}:
                os.close(descriptor)
            self._end = self._far = -1
            self.path = ""

    def say(self, octets: bytes) -> None:
        """Send."""
        if self.is_open:
            with contextlib.suppress(OSError):  # full, or the gadget's host is away
                os.write(self._end, octets if self._is_at_rate() else bytes(map(_garbled, octets)))

    def _open_gadget(self) -> None:
        """Open a tty that is there only while the gadget is plugged in."""
        try:
            self._end = os.open(self._gadget, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
            tty.setraw(self._end)
        except (OSError, termios.error):
            self._timer = self._loop.after(REOPEN_S, self._open_gadget)
            return
        self._timer = None
        self.path = self._gadget
        self._loop.add(self, READ)

    def _is_at_rate(self) -> bool:
        baud = self._baud()
        return baud is None or bool(termios.tcgetattr(self._far)[5] == getattr(termios, f"B{baud}", None))


def _garbled(octet: int) -> int:
    return (octet * 37 + 11) & 0xFF
