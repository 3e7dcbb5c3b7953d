"""UBX frames of u-blox receivers: encoder, and checksum.

    octets  0..1    b5 62: start of a frame
            2..3    class and id: together the kind, here one number (0x0107 is NAV-PVT)
            4..5    length of the payload, little-endian
            6..     payload
            last 2  8-bit Fletcher checksum from class to payload

messages.py decodes the payloads; wire/gnss/stream.py finds frames in a stream.
Source: u-blox F9 HPG 1.32 interface description, clauses 3.2 and 3.4.
"""

from enum import IntEnum
from itertools import accumulate
from typing import NamedTuple

SYNC = b"\xb5b"
OVERHEAD = 8  # octets of a frame without its payload
MAX_PAYLOAD = 8192  # the longest message of any receiver of the family is below 6 KiB


class Kind(IntEnum):
    """Kinds of UBX messages that this project uses."""

    NAV_STATUS = 0x0103
    NAV_PVT = 0x0107
    NAV_TIMELS = 0x0126
    RXM_RTCM = 0x0232
    ACK_NAK = 0x0500
    ACK_ACK = 0x0501
    CFG_RST = 0x0604
    CFG_VALSET = 0x068A
    CFG_VALGET = 0x068B
    MON_VER = 0x0A04
    MON_RF = 0x0A38
    TIM_TP = 0x0D01
    SEC_SIG = 0x2709


class UbxFrame(NamedTuple):
    """Complete frame; kind is class * 256 + id."""

    kind: int
    payload: bytes


def checksum(octets: bytes) -> bytes:
    """Return the Fletcher checksum, two octets: the sum of all octets, and the sum of the running sums."""
    return bytes((sum(octets) & 0xFF, sum(accumulate(octets)) & 0xFF))


def encode(kind: int, payload: bytes = b"") -> bytes:
    """Return a frame. Without a payload it is a poll: the receiver answers with its message of that kind."""
    assert len(payload) <= MAX_PAYLOAD
    body = kind.to_bytes(2) + len(payload).to_bytes(2, "little") + payload
    return SYNC + body + checksum(body)


def name(kind: int) -> str:
    """Return the name of a kind, such as NAV-PVT; for unknown kinds, class and id in hexadecimal."""
    try:
        return Kind(kind).name.replace("_", "-")
    except ValueError:
        return f"{kind >> 8:02X}-{kind & 0xFF:02X}"
