"""Line to a receiver: a serial port, found by USB place or path, that can be opened at several rates."""

from collections import deque
from collections.abc import Callable
from typing import Protocol

from board import usb
from board.machine import Machine
from board.runtime.errors import InterfaceError
from board.runtime.loop import Loop
from board.serial import SerialPort
from drivers.gnss.options import GnssOptions

# Most octets that wait for the line: half a second of corrections. Beyond it the oldest frames are dropped, because
# newer corrections are more useful.
MAX_WAITING = 16_384  # octets


class ReceiverLine(Protocol):
    """Line to a receiver: a serial port or an I2C bus.

    path     path of the port or bus, for messages.
    dropped  number of frames dropped because the line was too slow.
    """

    path: str
    dropped: int

    @property
    def is_open(self) -> bool:
        """Whether the line is open."""

    def open(self, baud: int) -> None:
        """Open the line, or open it again at another baud rate. Raises InterfaceError if that fails."""

    def write(self, frame: bytes) -> None:
        """Send a frame now or as soon as the line has room; if too many octets wait, a frame is dropped."""

    def close(self) -> None:
        """Close the line and discard waiting frames; idempotent."""


class SerialLine:
    """Line to a receiver on a serial port. It sends whole frames, and drops the oldest if the line is too slow.

    received  called with received octets.
    broken    called once with an error when the port is gone.
    """

    def __init__(
        self,
        loop: Loop,
        options: GnssOptions,
        machine: Machine,
        received: Callable[[bytes], None],
        broken: Callable[[InterfaceError], None],
    ) -> None:
        self.dropped = 0
        self.path = options.port
        self._loop = loop
        self._topology = options.usb
        self._machine = machine
        self._received = received
        self._broken = broken
        self._port: SerialPort | None = None
        self._frames: deque[bytes] = deque()
        self._octets = 0

    @property
    def is_open(self) -> bool:
        return self._port is not None

    def open(self, baud: int) -> None:
        """Open the port, or open it again at another baud rate. Raises InterfaceError if that fails."""
        self.close()
        if self._topology:
            self.path = usb.tty(self._machine, self._topology, 0)
        self._port = SerialPort(self._loop, self.path, baud, self._received, self._broken, self._drained)

    def write(self, frame: bytes) -> None:
        """Send a frame now, or after the frames that wait."""
        self._frames.append(frame)
        self._octets += len(frame)
        while self._octets > MAX_WAITING:
            self._octets -= len(self._frames.popleft())
            self.dropped += 1
        self._drained()

    def close(self) -> None:
        """Close the port and discard waiting frames; idempotent."""
        if self._port is not None:
            self._port.close()
            self._port = None
        self._frames.clear()
        self._octets = 0

    def _drained(self) -> None:
        while self._frames and self._port is not None and not self._port.is_busy:
            frame = self._frames.popleft()
            self._octets -= len(frame)
            self._port.write(frame)
