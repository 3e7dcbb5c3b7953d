"""The port of a simulated receiver: a pty, with the rate of a UART where it is one; or the end of a USB gadget."""

import termios
from collections.abc import Callable

from board.loop import Loop
from drivers.sim.tty_end import TtyEnd


class ReceiverLine:
    """Octets in by a call; octets out as far as somebody reads: what the pty does not take is lost, as on a UART.

    baud    the receiver's own rate, None where it has none: what comes at another is not understood, and what is
            said arrives as garbage.
    gadget  path of the tty that is used in place of a pty.
    """

    def __init__(
        self, loop: Loop, heard: Callable[[bytes], None], baud: Callable[[], int | None], gadget: str = ""
    ) -> None:
        self._heard = heard
        self._baud = baud
        self._end = TtyEnd(loop, self._hear, gadget)

    @property
    def path(self) -> str:
        """That an interface opens; empty while there is none."""
        return self._end.path

    @property
    def is_open(self) -> bool:
        return self._end.is_open

    def open(self) -> None:
        """Appear; the path of a pty is another one each time."""
        self._end.open()

    def close(self) -> None:
        """Disappear; idempotent."""
        self._end.close()

    def say(self, octets: bytes) -> None:
        """Send."""
        if self.is_open:
            self._end.say(octets if self._is_at_rate() else bytes(map(_garbled, octets)))

    def _hear(self, octets: bytes) -> None:
        if self._is_at_rate():
            self._heard(octets)

    def _is_at_rate(self) -> bool:
        baud = self._baud()
        return baud is None or self._end.speed == getattr(termios, f"B{baud}", None)


def _garbled(octet: int) -> int:
    return (octet * 37 + 11) & 0xFF
