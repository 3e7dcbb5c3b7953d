"""Port of a simulated receiver: a pty, with the baud rate of a UART if it is one, or the tty of a USB gadget."""

import termios
from collections.abc import Callable

from board.runtime.loop import Loop
from drivers.sim.tty_end import TtyEnd


class ReceiverLine:
    """Port of a receiver. Octets that the pty cannot take are lost, as on a UART.

    baud    returns the receiver's own baud rate, or None. If the far end has another rate, the receiver ignores what it
            hears, and its own octets arrive as garbage.
    gadget  path of a tty to use in place of a pty.
    """

    def __init__(
        self, loop: Loop, heard: Callable[[bytes], None], baud: Callable[[], int | None], gadget: str = ""
    ) -> None:
        self._heard = heard
        self._baud = baud
        self._end = TtyEnd(loop, self._hear, gadget)

    @property
    def path(self) -> str:
        """Path that an interface opens; empty while closed."""
        return self._end.path

    @property
    def is_open(self) -> bool:
        return self._end.is_open

    def open(self) -> None:
        """Create the port; a pty has another path each time."""
        self._end.open()

    def close(self) -> None:
        """Remove the port; idempotent."""
        self._end.close()

    def say(self, octets: bytes) -> None:
        """Send octets."""
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
