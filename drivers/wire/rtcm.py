"""RTCM 3 frames with corrections for differential positioning: builds and checks them, does not decode messages.

    octets  0       d3: start of a frame
            1..2    six zero bits, then the length of the message in ten bits
            3..     message, 0..1023 octets; its first 12 bits are the message number
            last 3  CRC-24Q over all octets before

Source: RTCM 10403.3, clause 4.
"""

from typing import NamedTuple

from board.runtime.errors import ProtocolError

PREAMBLE = b"\xd3"
OVERHEAD = 6  # octets of a frame without its message
MAX_MESSAGE = 1023

_POLYNOMIAL = 0x1864CFB


class RtcmFrame(NamedTuple):
    """Complete RTCM frame, with its preamble and CRC."""

    octets: bytes

    @property
    def message(self) -> bytes:
        return self.octets[3:-3]

    @property
    def number(self) -> int | None:
        """Message number, such as 1005 or 1077; None for an empty message."""
        return number(self.message)


def _row(octet: int) -> int:
    crc = octet << 16
    for _ in range(8):
        crc = crc << 1 ^ (_POLYNOMIAL if crc & 0x800000 else 0)
    return crc


_TABLE = tuple(_row(octet) for octet in range(256))


def crc24q(octets: bytes) -> int:
    """Return the CRC-24Q: polynomial 0x1864CFB, initial value 0. A frame including a correct CRC gives 0."""
    crc = 0
    for octet in octets:
        crc = (crc << 8 & 0xFFFFFF) ^ _TABLE[crc >> 16 ^ octet]
    return crc


def encode(message: bytes) -> bytes:
    """Return the frame of a message. Raises ProtocolError for a message of more than MAX_MESSAGE octets."""
    if len(message) > MAX_MESSAGE:
        raise ProtocolError(f"an RTCM message of {len(message)} octets: it has at most {MAX_MESSAGE}")
    body = PREAMBLE + len(message).to_bytes(2) + message
    return body + crc24q(body).to_bytes(3)


def number(message: bytes) -> int | None:
    """Return the number of a message, 0..4095; None if the message is too short."""
    return int.from_bytes(message[:2]) >> 4 if len(message) >= 2 else None
