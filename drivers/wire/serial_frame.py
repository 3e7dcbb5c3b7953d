"""Framing of PDUs on a serial line: start word, length, port, PDU, CRC-32.

    octets  0..1    56 32 ("V2"): start of a frame
            2..3    length of port and PDU: 2..1502, big-endian
            4..5    BTP port, big-endian; 0 if the sender gives none
            6..     PDU, 0..1500 octets
            last 4  CRC-32 of ISO 3309 (as of Ethernet and zip) over length, port and PDU, big-endian

The receiver finds the next frame after any garbage. It searches for 56 32. If length or checksum are wrong, the search
continues directly after these two octets. No octets are escaped, so a frame always has 10 octets of overhead.
"""

import binascii
from struct import Struct
from typing import NamedTuple

from board.runtime.errors import RequestError
from drivers.message import MAX_PDU
from drivers.reason import Reason
from drivers.wire.garbage import Garbage, Passed

SYNC = b"V2"
OVERHEAD = 10  # octets of a frame without its PDU

# A frame is given up after this silence. A USB adapter delivers octets every 16 ms.
GAP_S = 0.1

_HEADER = Struct(">HH")
_CHECKSUM = Struct(">I")
_SHORTEST, _LONGEST = 2, 2 + MAX_PDU


class Frame(NamedTuple):
    """Complete frame; port 0 means that the sender gave none."""

    port: int
    pdu: bytes


Event = Frame | Garbage


def encode(port: int, pdu: bytes) -> bytes:
    """Return the frame of a PDU for a BTP port 0..65535. Raises RequestError for a PDU of more than 1500 octets."""
    if len(pdu) > MAX_PDU:
        raise RequestError(f"a PDU of {len(pdu)} octets is longer than the {MAX_PDU} of a serial frame")
    body = _HEADER.pack(len(pdu) + 2, port) + pdu
    return SYNC + body + _CHECKSUM.pack(binascii.crc32(body))


class SerialFrames:
    """Parser of a serial stream; how the stream is split into reads does not change the frames.

    Every octet belongs to a frame or is counted as garbage. A run of garbage is one event: at the next frame, after
    silence on the line, or when the run exceeds the longest frame.
    """

    def __init__(self) -> None:
        self._waiting = bytearray()
        self._last = 0.0
        self._passed = Passed()

    def receive(self, octets: bytes, now: float) -> list[Event]:
        """Return the frames that the octets complete, and the garbage before them."""
        events: list[Event] = []
        self._waiting += octets
        self._last = now
        self._scan(events)
        if self._passed.octets > _LONGEST:
            events += self._passed.take()
        return events

    def deadline(self) -> float | None:
        """Return the time when expire() must be called; each receive() postpones it. None without octets to report."""
        return self._last + GAP_S if self._waiting or self._passed.octets else None

    def expire(self, now: float) -> list[Event]:
        """Discard an incomplete frame after a silence; search the octets after its start word for another frame."""
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
