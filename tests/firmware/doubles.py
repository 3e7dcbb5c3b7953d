"""Doubles of a station: scripted driver, noting station, handmade messages."""

import math
from collections.abc import Callable

from board.runtime.errors import StationError
from board.runtime.loop import Loop
from board.time.scales import TimeQuality
from drivers.contract import Can, Capabilities, Host, Sent
from drivers.message import UNKNOWN_TIME, Confirm, Ego, Indication, MessageType, Outcome, Position, Request
from firmware.config.tables import QueueOptions
from firmware.routing.drops import Drops
from firmware.routing.interface import Interface
from firmware.routing.options import Parsed
from firmware.topics import Topics

CAM_PDU = bytes.fromhex("02020000053900010203")
BOTH_WAYS = Can.RECEIVE | Can.TRANSMIT | Can.GEOBROADCAST
INGOLSTADT = Position(487668616, 114320680)


def pdu_of(number: int, station: int = 1337, body: bytes = b"body") -> bytes:
    """An ITS PDU: protocolVersion 2, messageID, stationID, then whatever."""
    return bytes((2, number)) + station.to_bytes(4, "big") + body


def request_of(
    number: int = 1,
    priority: int = 2,
    deadline: float = math.inf,
    accepted: float = 1000.0,
    pdu: bytes = CAM_PDU,
    kind: MessageType | None = None,
) -> Request:
    kind = kind or Topics().by_number[2]
    return Request(number, kind, pdu, 2001, accepted, deadline, priority, 2)


class ScriptedDriver:
    """A driver that notes what it is given, and does in start() and answers in send() what the test says."""

    def __init__(self, can: Can = BOTH_WAYS, broker: str = "") -> None:
        self.capabilities = Capabilities(can, "test", broker=broker)
        self.on_start: Callable[[Host], None] = lambda host: host.link(True, "plugged in")
        self.on_stop: Callable[[], None] = lambda: None
        self.answer: Sent | StationError = Sent.NOW
        self.sent: list[Request] = []
        self.starts = self.stops = self.refreshes = 0

    def start(self, host: Host) -> None:
        self.starts += 1
        self.on_start(host)

    def send(self, request: Request) -> Sent:
        if isinstance(self.answer, StationError):
            raise self.answer
        if self.answer is not Sent.BUSY:
            self.sent.append(request)
        return self.answer

    def refresh(self) -> None:
        self.refreshes += 1

    def stop(self) -> None:
        self.stops += 1
        self.on_stop()


class NotingStation:
    """firmware.routing.interface.UpperLayer that keeps all that it is told."""

    def __init__(self, position: Position | None = None) -> None:
        self.is_confirm_wanted = True
        self.quality = self.renewed = UNKNOWN_TIME
        self.quality_until = math.inf
        self.indications: list[Indication] = []
        self.requests: list[tuple[str, bytes, str, int | None, Interface]] = []
        self.confirms: list[Confirm] = []
        self.link_changes = 0
        self.position = position

    def renewed_quality(self) -> TimeQuality:
        return self.renewed

    def indicate(self, indication: Indication) -> None:
        self.indications.append(indication)

    def request(self, kind: MessageType, pdu: bytes, where: str, asked: Parsed, origin: Interface) -> None:
        self.requests.append((kind.name, pdu, where, asked.options.btp_port, origin))

    def confirm(self, confirm: Confirm) -> None:
        self.confirms.append(confirm)

    def links_changed(self) -> None:
        self.link_changes += 1

    def ego(self) -> Ego:
        return Ego(0, self.position or Position(), self.position is not None)

    def its_ms(self) -> int:
        return 0

    def outcomes(self) -> list[tuple[int, Outcome, object]]:
        return [(confirm.request.number, confirm.outcome, confirm.reason) for confirm in self.confirms]


def interface_of(
    loop: Loop,
    above: object,
    driver: ScriptedDriver | None = None,
    name: str = "g5",
    topics: Topics | None = None,
    drops: Drops | None = None,
    queue: int = 256,
    rate_per_s: float = 0.0,
) -> Interface:
    """An interface with its link up, as if its driver had been started."""
    driver = driver or ScriptedDriver()
    options = QueueOptions("scripted", queue, rate_per_s)
    interface = Interface(name, driver, options, loop, above, topics or Topics(), drops or Drops())
    driver.start(interface)
    return interface
