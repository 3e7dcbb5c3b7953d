"""The other end of a serial line: a pty whose path an interface opens as its serial port."""

import os
import pty
import tty

from board.loop import READ, WRITE, Loop
from drivers.wire.serial_frame import Event, SerialFrames, encode

BATCH = 4096


class SerialLine:
    """A station at the other end: it says PDUs, hears frames, and can be unplugged.

    reads  False: it takes nothing from the line, which is full some 4 KiB later.
    """

    def __init__(self, loop: Loop, reads: bool = True) -> None:
        self.heard: list[Event] = []
        self._loop = loop
        self._frames = SerialFrames()
        self._waiting = b""
        self._reads = reads
        self._end, far = pty.openpty()
        tty.setraw(far)
        self.path = os.ttyname(far)
        # Kept open: a pty whose far end nobody has open reports a hang-up.
        self._far = far
        os.set_blocking(self._end, False)
        loop.add(self, READ if reads else 0)

    def fileno(self) -> int:
        return self._end

    def ready(self, events: int) -> None:
        if events & WRITE:
            self._write()
        if events & READ:
            self.heard += self._frames.receive(os.read(self._end, BATCH), self._loop.clock())

    def say(self, port: int, pdu: bytes) -> None:
        """Send a frame."""
        self.say_octets(encode(port, pdu))

    def say_octets(self, octets: bytes) -> None:
        """Send any octets, as many as the line takes now and the rest as it empties."""
        self._waiting += octets
        self._write()

    def listen(self) -> None:
        """Read from now on."""
        self._reads = True
        self._want()

    def unplug(self) -> None:
        """The port disappears; idempotent."""
        if self._end >= 0:
            self._loop.remove(self)
            os.close(self._end)
            os.close(self._far)
            self._end = self._far = -1

    def _write(self) -> None:
        try:
            self._waiting = self._waiting[os.write(self._end, self._waiting) :]
        except BlockingIOError:
            return self._want()
        return self._want()

    def _want(self) -> None:
        self._loop.want(self, (READ if self._reads else 0) | (WRITE if self._waiting else 0))
