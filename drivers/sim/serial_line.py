"""The other end of a serial line: a pty whose path an interface opens as its serial port."""

from board.loop import Loop
from drivers.sim.tty_end import TtyEnd
from drivers.wire.serial_frame import Event, SerialFrames, encode

KEPT = 1 << 24  # octets that wait for who does not read


class SerialLine:
    """A station at the other end: it says PDUs, hears frames, and can be unplugged.

    reads  False: it takes nothing from the line, which is full some 4 KiB later.
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
        """Send any octets, as many as the line takes now and the rest as it empties."""
        self._end.say(octets)

    def listen(self) -> None:
        """Read from now on."""
        self._end.listen()

    def unplug(self) -> None:
        """The port disappears; idempotent."""
        self._end.close()

    def _hear(self, octets: bytes) -> None:
        self.heard += self._frames.receive(octets, self._loop.clock())
