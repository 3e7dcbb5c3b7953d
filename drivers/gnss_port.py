"""The line to a receiver: a serial port, found by place or path, opened at one rate after another."""

from collections import deque
from collections.abc import Callable
from typing import Protocol

from board import usb
from board.errors import InterfaceError
from board.loop import Loop
from board.machine import Machine
from board.serial import SerialPort
from drivers.gnss_options import GnssOptions

# What may wait for the line: half a second of corrections. Later ones are worth more than these.
MAX_WAITING = 16_384  # octets


class Line(Protocol):
    """What a receiver is at, whatever that is.

    path     of the port or bus, for people.
    dropped  frames that the line was too slow for.
    """

    path: str
    dropped: int

    def open(self, baud: int) -> None:
        """Open, or open again at another rate. Raises InterfaceError."""

    def write(self, frame: bytes) -> None:
        """Send a frame now or a little later, or drop it where it is too much."""

    def close(self) -> None:
        """Idempotent; what waits is lost."""


class SerialLine:
    """Octets in by a call; octets out in whole frames, the oldest dropped where the line is too slow.

    received, broken  as those of SerialPort.
    """

    def __init__(
        self,
        loop: Loop,
        options: GnssOptions,
        machine: Machine,
        received: Callable[[bytes], None],
        broken: Callable[[InterfaceError], None],
    ) -> None:
        self.dropped = 0  # frames
        self.path = options.port
        self._loop = loop
        self._topology = options.usb
        self._machine = machine
        self._received = received
        self._broken = broken
        self._port: SerialPort | None = None
        self._frames: deque[bytes] = deque()
        self._octets = 0

    def open(self, baud: int) -> None:
        """Open, or open again at another rate. Raises InterfaceError."""
        self.close()
        if self._topology:
            self.path = usb.tty(self._machine, self._topology, 0)
        self._port = SerialPort(self._loop, self.path, baud, self._received, self._broken, self._drained)

    def write(self, frame: bytes) -> None:
        """Send a frame now, or as soon as those before it have gone."""
        self._frames.append(frame)
        self._octets += len(frame)
        while self._octets > MAX_WAITING:
            self._octets -= len(self._frames.popleft())
            self.dropped += 1
        self._drained()

    def close(self) -> None:
        """Idempotent; what waits is lost."""
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
