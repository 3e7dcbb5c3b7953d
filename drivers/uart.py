"""Driver for a serial line: PDUs in frames with length and checksum, to another station or a modem."""

import time
from dataclasses import dataclass
from typing import Annotated, ClassVar

from board.runtime.describe import Range
from board.runtime.loop import Timer
from board.serial import SerialPort
from drivers.contract import BUSY, LATER, NOW, Can, Capabilities, Host, Sent, Shared
from drivers.message import NO_RX_INFO, Request, RxInfo
from drivers.wire.serial_frame import Event, Frame, SerialFrames, encode

BITS = 10  # bits per octet on the line: a start bit, eight data bits, a stop bit

# Transmission time in seconds that the driver may have written to the kernel in advance. The kernel would buffer
# 4096 octets, 0.36 s at 115,200 baud, and a DENM could not overtake them. Messages wait in the station's queue instead.
AHEAD_S = 0.02


@dataclass(frozen=True)
class UartOptions:
    """PDUs on a serial line, in frames with length, BTP port and checksum.

    device  path of the serial port. A path in /dev/serial/by-id does not change with the order of plugging.
    baud    speed of the line.
    rtscts  hardware flow control by RTS and CTS.
    """

    device: str
    baud: Annotated[int, Range(300, 4_000_000)] = 115_200
    rtscts: bool = False


class Uart:
    """Driver for PDUs on a serial line, in frames of drivers/wire/serial_frame.py."""

    Options: ClassVar[type] = UartOptions
    capabilities: ClassVar[Capabilities] = Capabilities(
        can=Can.RECEIVE | Can.TRANSMIT, technology="uart", metadata=frozenset({"btp_port"})
    )

    def __init__(self, options: UartOptions, shared: Shared) -> None:
        self._options = options
        self._line: _Line | None = None

    def start(self, host: Host) -> None:
        self._line = _Line(self._options, host)
        host.link(True, f"{self._options.device} at {self._options.baud} baud")

    def send(self, request: Request) -> Sent:
        return BUSY if self._line is None else self._line.send(request)

    def refresh(self) -> None:
        """Do nothing. The kernel counts overruns of a UART, but USB adapters do not report them.

        The checksum of the frames detects lost octets.
        """

    def stop(self) -> None:
        if self._line is not None:
            self._line.close()
            self._line = None


class _Line:
    """State between start() and stop(): the open port. Raises InterfaceError if it cannot be opened."""

    def __init__(self, options: UartOptions, host: Host) -> None:
        self._host = host
        self._octet_s = BITS / options.baud
        self._frames = SerialFrames()
        self._request: Request | None = None  # request that the port has only partly written
        self._free_at = host.loop.clock()
        self._gap: Timer | None = None
        self._pace: Timer | None = None
        self._port = SerialPort(
            host.loop, options.device, options.baud, self._received, host.fail, self._drained, options.rtscts
        )

    def send(self, request: Request) -> Sent:
        loop, port = self._host.loop, self._port
        now = loop.clock()
        if port.is_busy:
            return BUSY
        if self._free_at > now + AHEAD_S:
            if self._pace is None:
                self._pace = loop.after(self._free_at - AHEAD_S - now, self._has_room)
            return BUSY
        octets = encode(request.btp_port, request.pdu)
        self._free_at = max(now, self._free_at) + len(octets) * self._octet_s
        if port.write(octets):
            return NOW
        if not port.is_busy:  # the port failed while it wrote, and has already called host.fail()
            return BUSY
        self._request = request
        return LATER

    def close(self) -> None:
        """Close the port and discard the request that waits in it."""
        for timer in (self._gap, self._pace):
            if timer is not None:
                timer.cancel()
        self._port.close()

    def _received(self, octets: bytes) -> None:
        self._take(self._frames.receive(octets, self._host.loop.clock()))

    def _silent(self) -> None:
        self._gap = None
        self._take(self._frames.expire(self._host.loop.clock()))

    def _take(self, events: list[Event]) -> None:
        received_ns = time.time_ns()
        for event in events:
            if not self._port.is_open:  # an earlier indication of this batch led to stop()
                return
            if isinstance(event, Frame):
                rx = RxInfo(btp_port=event.port) if event.port else NO_RX_INFO
                self._host.indicate(event.pdu, received_ns, rx)
            else:
                self._host.drop(event.reason, event.sample)
        deadline, loop = self._frames.deadline(), self._host.loop
        if deadline is not None and self._gap is None and self._port.is_open:
            # Received octets postpone the deadline but do not move the timer. It then fires too early, finds
            # nothing expired, and is set again.
            self._gap = loop.after(max(0.0, deadline - loop.clock()), self._silent)

    def _drained(self) -> None:
        request, self._request = self._request, None
        if request is not None:
            self._host.confirm(request)
        self._host.writable()

    def _has_room(self) -> None:
        self._pace = None
        self._host.writable()
