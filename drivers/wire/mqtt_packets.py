"""Packets of an MQTT stream: passes on whole ones of a bounded size.

Source: MQTT 5.0, clauses 2.1 (fixed header) and 3.3 (PUBLISH); the same in 3.1.1.
"""

from collections.abc import Iterator
from typing import NamedTuple

from board.runtime.errors import ProtocolError

CONNACK, PUBLISH = 2, 3
MAX_LENGTH_OCTETS = 4

# Bits of the first octet: the packet type, and the bit that is set for QoS 2 and for the invalid QoS 3.
_KIND_AND_QOS_2, _PUBLISH_QOS_2 = 0xF4, 0x34

# First octets of a TLS record (RFC 8446, clause 5.1): an alert or a handshake of version 3.x.
_TLS = (b"\x15\x03", b"\x16\x03")


class Oversized(NamedTuple):
    """PUBLISH packet that is longer than the limit; its payload is discarded.

    number  packet identifier for the acknowledgement; 0 if the broker expects none.
    sample  topic and packet identifier.
    """

    number: int
    sample: bytes


class Packets:
    """Parser of the packets that a broker sends on one connection. All subscriptions have QoS 0 or 1.

    limit  largest number of octets after the fixed header.
    """

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._buffer = bytearray()
        self._to_skip = 0
        self._is_first = True

    def receive(self, octets: bytes) -> Iterator[bytes | Oversized]:
        """Yield the packets that the octets complete.

        Raises ProtocolError for an invalid packet; the rest of the stream is then unreadable.
        """
        if self._to_skip:
            skipped = min(self._to_skip, len(octets))
            self._to_skip -= skipped
            octets = octets[skipped:]
        buffer = self._buffer
        buffer += octets
        at = 0
        while (header := self._header(at)) is not None:
            start, length = header
            if buffer[at] & _KIND_AND_QOS_2 == _PUBLISH_QOS_2:
                raise ProtocolError("sends a message at QoS 2 without a subscription at QoS 2")
            if length > self._limit:
                found = self._oversized(at, start, length)
                if found is None:
                    break
                yield found
                self._to_skip = max(0, start + length - len(buffer))
                at = min(start + length, len(buffer))
            elif len(buffer) < start + length:
                break
            else:
                yield bytes(buffer[at : start + length])
                at = start + length
        del buffer[:at]

    def _header(self, at: int) -> tuple[int, int] | None:
        """Parse the fixed header at `at`: return the index after it and the packet's remaining length.

        Returns None while the header is incomplete. Raises ProtocolError for an invalid one.
        """
        buffer = self._buffer
        if self._is_first and len(buffer) > 1:
            self._is_first = False
            _check_first(buffer)
        length = 0
        for place in range(1, MAX_LENGTH_OCTETS + 1):
            if at + place >= len(buffer):
                return None
            octet = buffer[at + place]
            length |= (octet & 0x7F) << 7 * (place - 1)
            if octet < 0x80:
                return at + place + 1, length
        raise ProtocolError("sends a packet whose length has more than 4 octets")

    def _oversized(self, at: int, start: int, length: int) -> Oversized | None:
        """Return the report of an oversized packet; None before its topic and packet identifier have arrived."""
        buffer = self._buffer
        if buffer[at] >> 4 != PUBLISH:
            raise ProtocolError(f"announces a packet of {length} octets that holds no message")
        has_number = bool(buffer[at] & 6)
        end = start + 2
        if len(buffer) >= end:
            end += int.from_bytes(buffer[start:end]) + 2 * has_number
        if len(buffer) < end:
            return None
        return Oversized(int.from_bytes(buffer[end - 2 : end]) if has_number else 0, bytes(buffer[start + 2 : end]))


def _check_first(octets: bytearray) -> None:
    """Raise ProtocolError if the first packet is not a CONNACK: then the peer is not an MQTT broker."""
    if octets[0] >> 4 == CONNACK:
        return
    if bytes(octets[:2]) in _TLS:
        raise ProtocolError("speaks TLS at this port", "write mqtts:// in url")
    raise ProtocolError(f"does not answer by MQTT: {bytes(octets[:8])!r}", "correct host and port in url")
