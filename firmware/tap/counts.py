"""Counts of a tap: messages by type, unreadable ones by reason."""

import time
from collections import Counter
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from drivers.reason import MEANING, Reason
from drivers.wire.v2n.message import Delivery, RefusedError
from firmware.topics import Topics

MAX_SAMPLE = 32  # octets kept of an unreadable payload
_TYPES = Topics()


class Taken(NamedTuple):
    """Message from a delivery.

    btp_port     BTP port; None if unknown.
    source       sender by the profile; may be empty.
    topic        MQTT topic.
    received_ns  Unix time of its arrival in nanoseconds.
    """

    pdu: bytes
    btp_port: int | None
    source: str
    topic: str
    received_ns: int

    @property
    def type(self) -> str:
        """Type name of the messageID; the number itself for an unknown messageID."""
        return _TYPES.by_number[self.pdu[1]].name or str(self.pdu[1])

    @property
    def station_id(self) -> int:
        """stationID of the ITS PDU header (TS 102 894-2, ItsPduHeader)."""
        return int.from_bytes(self.pdu[2:6])

    def record(self) -> dict[str, object]:
        """Return the message as an object for `--json` and JSON lines, with the keys of `captain listen --json`."""
        return {
            "type": self.type,
            "station_id": self.station_id,
            "message_id": self.pdu[1],
            "protocol_version": self.pdu[0],
            "octets": len(self.pdu),
            "received": self.received_ns // 1000 / 1e6,
            "btp_port": self.btp_port,
            "topic": self.topic,
            "source": self.source,
            "hex": self.pdu.hex(),
        }


class Unread(NamedTuple):
    """Unreadable deliveries with one reason.

    number  number of deliveries.
    why     explanation of the last one.
    sample  first octets of the last one.
    """

    number: int
    why: str
    sample: bytes


class Counts:
    """Counts of a tap since its start."""

    def __init__(self) -> None:
        self.started = time.monotonic()
        self.total = 0
        self.types: Counter[str] = Counter()
        self.octets = 0  # octets of all payloads, readable or not
        self.copies = 0  # messages whose other form, on another topic, was read
        self.unwanted = 0  # messages of types that were not requested
        self.beyond = 0  # messages received after the requested count, while leaving
        self.unread: dict[Reason, Unread] = {}
        self.unrecorded: Counter[str] = Counter()

    def add(self, kind: str) -> None:
        self.total += 1
        self.types[kind] += 1

    def refuse(self, error: RefusedError, delivery: Delivery) -> None:
        before = self.unread.get(error.reason)
        number = 1 + (before.number if before else 0)
        self.unread[error.reason] = Unread(number, error.message, delivery.payload[:MAX_SAMPLE])

    def lines(self, connection: Mapping[str, float]) -> Iterator[str]:
        """Yield the lines of the final report; connection: counts of the Connection."""
        seconds = time.monotonic() - self.started
        types = ", ".join(f"{count} {kind}" for kind, count in sorted(self.types.items()))
        rate = self.total / seconds if seconds > 0 else 0.0
        yield f"{self.total} messages in {seconds:.1f} s ({rate:.1f}/s)" + (f": {types}" if types else "")
        yield f"{self.octets} octets of payload"
        yield from self.complaints()
        if self.copies:
            yield f"{self.copies} further copies of these messages in another form"
        if self.unwanted:
            yield f"{self.unwanted} of other types"
        if self.beyond:
            yield f"{self.beyond} more arrived during the disconnection, and were not shown"
        if connection.get("losses"):
            yield f"connection lost {connection['losses']:.0f} x, {connection['gap_s']:.1f} s without it"
        if connection.get("repeated"):
            yield f"{connection['repeated']:.0f} of them sent again by the broker: possibly twice"
        if connection.get("dropped"):
            yield f"the broker reports {connection['dropped']:.0f} dropped messages of all its clients meanwhile"

    def complaints(self) -> Iterator[str]:
        """Yield one line per reason for unreadable deliveries and for messages that were not recorded."""
        for reason, (count, why, sample) in sorted(self.unread.items()):
            yield f"unreadable: {count} {reason}: {MEANING[reason]}; the last: {why} ({sample.hex()})"
        for why, count in sorted(self.unrecorded.items()):
            yield f"not recorded: {count}: {why}"
