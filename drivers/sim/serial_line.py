"""Simulated far end of a serial line: a pty that an interface opens as its serial port."""

from board.runtime.loop import Loop
from drivers.sim.tty_end import TtyEnd
from drivers.wire.serial_frame import Event, SerialFrames, encode

KEPT = 1 << 24  # octets that are kept for a reader that does not read


class SerialLine:
    """Station at the far end: it sends PDUs, records received frames, and can be unplugged.

    reads  False: it does not read the line, which is full after about 4 KiB.
    """

    def __init__(self, loop: Loop, reads: bool = True) -> None:
        self.heard: list[Event] = []
        self._loop = loop
        self._frames = SerialFrames()
        self._end = TtyEnd(loop, self._hear, kept=KEPT, reads=reads)
        self._end.open()
        self.path = self._end.path

    def say(self, port: int, pdu: bytes) -> None:
        """Send a frame."""
        self.say_octets(encode(port, pdu))

    def say_octets(self, octets: bytes) -> None:
        """Send octets: at once as many as the line takes, the rest when it can take more."""
        self._end.say(octets)

    def listen(self) -> None:
        """Start to read the line."""
        self._end.listen()

    def unplug(self) -> None:
        """Remove the port; idempotent."""
        self._end.close()

    def _hear(self, octets: bytes) -> None:
        self.heard += self._frames.receive(octets, self._loop.clock())
