"""UBX frames of u-blox receivers: built, and checked.

    octets  0..1    b5 62: a frame begins
            2..3    class and id: together the kind, here one number (0x0107 is NAV-PVT)
            4..5    length of the payload, little-endian
            6..     payload
            last 2  8-bit Fletcher checksum over class to payload

What the payloads mean stands in ubx_messages.py; frames are found in a stream by gnss_stream.py.
Source: u-blox F9 HPG 1.32 interface description, clauses 3.2 and 3.4.
"""

from enum import IntEnum
from itertools import accumulate
from typing import NamedTuple

SYNC = b"\xb5b"
OVERHEAD = 8  # octets of a frame beside its payload
MAX_PAYLOAD = 8192  # the longest that any receiver of the family sends is below 6 KiB


class Kind(IntEnum):
    """Kinds that this project uses."""

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


class Frame(NamedTuple):
    """A frame that came over whole: kind is class * 256 + id."""

    kind: int
    payload: bytes


def checksum(octets: bytes) -> bytes:
    """Fletcher checksum, two octets: the sum of all, and the sum of the sums after each."""
    return bytes((sum(octets) & 0xFF, sum(accumulate(octets)) & 0xFF))


def encode(kind: int, payload: bytes = b"") -> bytes:
    """A frame; without a payload it polls: the receiver answers with its message of that kind."""
    assert len(payload) <= MAX_PAYLOAD
    body = kind.to_bytes(2) + len(payload).to_bytes(2, "little") + payload
    return SYNC + body + checksum(body)


def name(kind: int) -> str:
    """NAV-PVT, or class and id in hexadecimal."""
    try:
        return Kind(kind).name.replace("_", "-")
    except ValueError:
        return f"{kind >> 8:02X}-{kind & 0xFF:02X}"
