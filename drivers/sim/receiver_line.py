"""The port of a simulated receiver: a pty, with the rate of a UART where it is one."""

import contextlib
import os
import pty
import termios
import tty
from collections.abc import Callable

from board.loop import READ, Loop

BATCH = 4096


class ReceiverLine:
    """Octets in by a call; octets out as far as somebody reads: what the pty does not take is lost, as on a UART.

    baud  the receiver's own rate, None where it has none: what comes at another is not understood, and what is
          said arrives as garbage.
    """

    def __init__(self, loop: Loop, heard: Callable[[bytes], None], baud: Callable[[], int | None]) -> None:
        self.path = ""
        self._loop = loop
        self._heard = heard
        self._baud = baud
        self._end = self._far = -1

    @property
    def is_open(self) -> bool:
        return self._end >= 0

    def fileno(self) -> int:
        return self._end

    def ready(self, events: int) -> None:
        octets = os.read(self._end, BATCH)
        if self._is_at_rate():
            self._heard(octets)

    def open(self) -> None:
        """Appear; path is another one each time."""
        # The far end stays open: a pty whose far end nobody has open reports a hang-up.
        self._end, self._far = pty.openpty()
        tty.setraw(self._far)
        os.set_blocking(self._end, False)
        self.path = os.ttyname(self._far)
        self._loop.add(self, READ)

    def close(self) -> None:
        """Disappear; idempotent."""
        if self.is_open:
            self._loop.remove(self)
            os.close(self._end)
            os.close(self._far)
            self._end = self._far = -1
            self.path = ""

    def say(self, octets: bytes) -> None:
        """Send."""
        if self.is_open:
            with contextlib.suppress(BlockingIOError):
                os.write(self._end, octets if self._is_at_rate() else bytes(map(_garbled, octets)))

    def _is_at_rate(self) -> bool:
        baud = self._baud()
        return baud is None or bool(termios.tcgetattr(self._far)[5] == getattr(termios, f"B{baud}", None))


def _garbled(octet: int) -> int:
    return (octet * 37 + 11) & 0xFF
