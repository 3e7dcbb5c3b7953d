"""A serial line as an interface: PDUs in frames with length and checksum, between two stations or to a modem."""

import time
from dataclasses import dataclass
from typing import Annotated, ClassVar

from board.describe import Range
from board.errors import InterfaceError
from board.loop import Timer
from board.serial import SerialPort
from drivers.contract import BUSY, LATER, NOW, Can, Capabilities, Host, Sent, Shared
from drivers.message import NO_RX_INFO, Request, RxInfo
from drivers.wire.serial_frame import Event, Frame, SerialFrames, encode

BITS = 10  # of an octet on the line: start, eight, stop

# How much of the line's time may be written ahead. The kernel would take 4096 octets, 0.36 s at 115,200 baud, and
# no DENM could overtake them; the station's own queue is where messages wait in their order.
AHEAD_S = 0.02


@dataclass(frozen=True)
class UartOptions:
    """Options of an interface with driver = "uart".

    device  path of the serial port; one of /dev/serial/by-id stays the same whatever else is plugged in.
    baud    bits per second.
    rtscts  whether the other end says by RTS and CTS when it can take octets.
    """

    device: str
    baud: Annotated[int, Range(300, 4_000_000)] = 115_200
    rtscts: bool = False


class Uart:
    """PDUs on a serial line, framed as drivers/wire/serial_frame.py says."""

    Options: ClassVar[type] = UartOptions
    capabilities: ClassVar[Capabilities] = Capabilities(
        can=Can.RECEIVE | Can.TRANSMIT, technology="uart", metadata=frozenset({"btp_port"})
    )

    def __init__(self, options: UartOptions, shared: Shared) -> None:
        self._options = options
        self._port: SerialPort | None = None
        self._gap: Timer | None = None
        self._pace: Timer | None = None

    def start(self, host: Host) -> None:
        options = self._options
        self._host = host
        self._frames = SerialFrames()
        self._request: Request | None = None
        self._free_at = host.loop.clock()
        self._port = SerialPort(
            host.loop, options.device, options.baud, self._received, self._broken, self._drained, options.rtscts
        )
        host.link(True, f"{options.device} at {options.baud} baud")

    def send(self, request: Request) -> Sent:
        loop, port = self._host.loop, self._port
        now = loop.clock()
        if port is None or port.is_busy:
            return BUSY
        if self._free_at > now + AHEAD_S:
            if self._pace is None:
                self._pace = loop.after(self._free_at - AHEAD_S - now, self._has_room)
            return BUSY
        octets = encode(request.btp_port, request.pdu)
        self._free_at = max(now, self._free_at) + len(octets) * BITS / self._options.baud
        if port.write(octets):
            return NOW
        if not port.is_busy:  # it broke, and the host knows
            return BUSY
        self._request = request
        return LATER

    def refresh(self) -> None:
        """The kernel counts overruns of a UART, but a USB adapter never tells it: the checksum notices what is lost."""

    def stop(self) -> None:
        for timer in (self._gap, self._pace):
            if timer is not None:
                timer.cancel()
        self._gap = self._pace = None
        if self._port is not None:
            self._port.close()
            self._port = None

    def _received(self, octets: bytes) -> None:
        self._take(self._frames.receive(octets, self._host.loop.clock()))

    def _silent(self) -> None:
        self._gap = None
        self._take(self._frames.expire(self._host.loop.clock()))

    def _take(self, events: list[Event]) -> None:
        received_ns = time.time_ns()
        for event in events:
            if self._port is None:  # what was indicated stopped the interface
                return
            if isinstance(event, Frame):
                rx = RxInfo(btp_port=event.port) if event.port else NO_RX_INFO
                self._host.indicate(event.pdu, received_ns, rx)
            else:
                self._host.drop(event.reason, event.sample)
        deadline, loop = self._frames.deadline(), self._host.loop
        if deadline is not None and self._gap is None and self._port is not None:
            # Octets that come move the deadline: the timer then comes early, finds nothing and is set again.
            self._gap = loop.after(max(0.0, deadline - loop.clock()), self._silent)

    def _drained(self) -> None:
        request, self._request = self._request, None
        if request is not None:
            self._host.confirm(request)
        self._host.writable()

    def _has_room(self) -> None:
        self._pace = None
        self._host.writable()

    def _broken(self, error: InterfaceError) -> None:
        self._host.fail(error)
