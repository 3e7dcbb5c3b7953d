"""PDUs on a serial line: where each begins and ends, and whether it came over whole.

    octets  0..1    56 32 ("V2"): a frame begins
            2..3    length of what stands between here and the checksum: 2..1502, big-endian
            4..5    BTP port, big-endian; 0 where the sender names none
            6..     PDU, 0..1500 octets
            last 4  CRC-32 of ISO 3309 (as of Ethernet and zip) over length, port and PDU, big-endian

The receiver finds the next frame after any garbage: it looks for 56 32, and where length or checksum disagree it goes
on looking right behind them. Nothing is escaped, so a frame costs 10 octets whatever is in it.
"""

import binascii
from struct import Struct
from typing import NamedTuple

from board.errors import RequestError
from drivers.message import MAX_PDU
from drivers.reason import Reason
from drivers.wire.garbage import Garbage, Passed

SYNC = b"V2"
OVERHEAD = 10  # octets of a frame beside its PDU

# Silence inside a frame after which its end is not waited for: a USB adapter hands octets over every 16 ms.
GAP_S = 0.1

_HEADER = Struct(">HH")
_CHECKSUM = Struct(">I")
_SHORTEST, _LONGEST = 2, 2 + MAX_PDU


class Frame(NamedTuple):
    """A PDU came over whole; port 0 says nothing."""

    port: int
    pdu: bytes


Event = Frame | Garbage


def encode(port: int, pdu: bytes) -> bytes:
    """The frame of a PDU of at most 1500 octets for a BTP port 0..65535. Raises RequestError for a longer one."""
    if len(pdu) > MAX_PDU:
        raise RequestError(f"a PDU of {len(pdu)} octets is longer than the {MAX_PDU} of a serial frame")
    body = _HEADER.pack(len(pdu) + 2, port) + pdu
    return SYNC + body + _CHECKSUM.pack(binascii.crc32(body))


class SerialFrames:
    """Octets in, frames out; the frames do not depend on how the octets were cut.

    Every octet is in a frame or counted as garbage. Garbage is told in one piece: at the next frame, when the line
    falls silent, or when it gets long.
    """

    def __init__(self) -> None:
        self._waiting = bytearray()
        self._last = 0.0
        self._passed = Passed()

    def receive(self, octets: bytes, now: float) -> list[Event]:
        """The frames that octets complete, and the garbage in front of them."""
        events: list[Event] = []
        self._waiting += octets
        self._last = now
        self._scan(events)
        if self._passed.octets > _LONGEST:
            events += self._passed.take()
        return events

    def deadline(self) -> float | None:
        """When expire() wants to be called; octets that come move it away."""
        return self._last + GAP_S if self._waiting or self._passed.octets else None

    def expire(self, now: float) -> list[Event]:
        """Give up an unfinished frame after a silence; what stands behind its beginning may hold another."""
        events: list[Event] = []
        deadline = self.deadline()
        if deadline is None or now < deadline:
            return events
        while self._waiting:
            self._skip(min(len(SYNC), len(self._waiting)))
            self._scan(events)
        events += self._passed.take()
        return events

    def _scan(self, events: list[Event]) -> None:
        waiting = self._waiting
        while True:
            start = waiting.find(SYNC)
            if start < 0:
                self._skip(len(waiting) - waiting.endswith(SYNC[:1]))
                return
            self._skip(start)
            if len(waiting) < 4:
                return
            length = int.from_bytes(waiting[2:4])
            if not _SHORTEST <= length <= _LONGEST:
                self._skip(len(SYNC))
                continue
            end = 4 + length
            if len(waiting) < end + 4:
                return
            if binascii.crc32(waiting[2:end]) != int.from_bytes(waiting[end : end + 4]):
                self._passed.reason = Reason.CHECKSUM
                self._skip(len(SYNC))
                continue
            events += self._passed.take()
            events.append(Frame(int.from_bytes(waiting[4:6]), bytes(waiting[6:end])))
            del waiting[: end + 4]

    def _skip(self, octets: int) -> None:
        self._passed.add(self._waiting, 0, octets)
        del self._waiting[:octets]
