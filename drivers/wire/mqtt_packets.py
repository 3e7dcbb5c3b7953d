"""Where the packets of an MQTT stream begin and end: only whole ones of a bearable size reach the client library.

Source: MQTT 5.0, clauses 2.1 (fixed header) and 3.3 (PUBLISH); the same in 3.1.1.
"""

from collections.abc import Iterator
from typing import NamedTuple

from board.errors import ProtocolError

CONNACK, PUBLISH = 2, 3
MAX_LENGTH_OCTETS = 4

# Of the first octet: the type, and the bit that qualities of service 2 and 3 (which is none) have.
_KIND_AND_QOS_2, _PUBLISH_QOS_2 = 0xF4, 0x34

# First octets of a TLS record (RFC 8446, clause 5.1): an alert or a handshake of version 3.x.
_TLS = (b"\x15\x03", b"\x16\x03")


class Oversized(NamedTuple):
    """A PUBLISH that is longer than the limit; its payload is not kept.

    number  that an acknowledgement names; 0 where none is wanted.
    sample  of it, from the topic on.
    """

    number: int
    sample: bytes


class Packets:
    """The broker's side of one connection whose subscriptions are all of quality of service 1 at most.

    limit  octets behind the fixed header that a packet may have.
    """

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._buffer = bytearray()
        self._to_skip = 0
        self._is_first = True

    def receive(self, octets: bytes) -> Iterator[bytes | Oversized]:
        """Packets that are whole by now. Raises ProtocolError: nothing that follows can be read."""
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
                raise ProtocolError("sends a message by quality of service 2, which nobody has asked for")
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
        """Where the rest of the packet begins that begins at `at`, and its length; None: not there yet."""
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
        """What is told of it, once topic and number are there."""
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
    """A broker's first packet is a CONNACK: what sends anything else is none."""
    if octets[0] >> 4 == CONNACK:
        return
    if bytes(octets[:2]) in _TLS:
        raise ProtocolError("speaks TLS at this port", "write mqtts:// in url")
    raise ProtocolError(f"answers with octets that are no MQTT: {bytes(octets[:8])!r}", "correct host and port in url")
