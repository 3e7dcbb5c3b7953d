"""RTCM 3 frames: corrections for differential positioning, built and checked. What is in them is for the receiver.

    octets  0       d3: a frame begins
            1..2    six zero bits, and the length of the message in ten
            3..     message, 0..1023 octets; its first 12 bits are its number
            last 3  CRC-24Q over all before

Source: RTCM 10403.3, clause 4.
"""

from typing import NamedTuple

from board.errors import ProtocolError

PREAMBLE = b"\xd3"
OVERHEAD = 6  # octets of a frame beside its message
MAX_MESSAGE = 1023

_POLYNOMIAL = 0x1864CFB


class Frame(NamedTuple):
    """A frame that came over whole, with its preamble and CRC."""

    octets: bytes

    @property
    def message(self) -> bytes:
        return self.octets[3:-3]

    @property
    def number(self) -> int | None:
        """1005, 1077, ...; None for an empty message."""
        return number(self.message)


def _row(octet: int) -> int:
    crc = octet << 16
    for _ in range(8):
        crc = crc << 1 ^ (_POLYNOMIAL if crc & 0x800000 else 0)
    return crc


_TABLE = tuple(_row(octet) for octet in range(256))


def crc24q(octets: bytes) -> int:
    """CRC-24Q: polynomial 0x1864CFB, begun with zero. Of a frame with its CRC it is 0."""
    crc = 0
    for octet in octets:
        crc = (crc << 8 & 0xFFFFFF) ^ _TABLE[crc >> 16 ^ octet]
    return crc


def encode(message: bytes) -> bytes:
    """The frame of a message. Raises ProtocolError for one that is too long."""
    if len(message) > MAX_MESSAGE:
        raise ProtocolError(f"an RTCM message of {len(message)} octets: it has at most {MAX_MESSAGE}")
    body = PREAMBLE + len(message).to_bytes(2) + message
    return body + crc24q(body).to_bytes(3)


def number(message: bytes) -> int | None:
    """A message's number, 0..4095; None where it is too short to have one."""
    return int.from_bytes(message[:2]) >> 4 if len(message) >= 2 else None
