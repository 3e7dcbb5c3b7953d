"""The Basic Transport Protocol, EN 302 636-5-1 V2.2.1: four octets that say which message follows."""

from struct import Struct
from typing import NamedTuple

from board.errors import ProtocolError

SIZE = 4  # octets of both headers: two 16-bit numbers, clauses 7.2.2 (BTP-A) and 7.3.2 (BTP-B)

_HEADER = Struct(">HH")


class BtpA(NamedTuple):
    """Header of interactive transport: the receiver can answer."""

    destination_port: int
    source_port: int


class BtpB(NamedTuple):
    """Header of transport that needs no answer: what ITS messages use. port_info 0 is "not used"."""

    destination_port: int
    port_info: int = 0


def encode(header: BtpA | BtpB, pdu: bytes) -> bytes:
    """A BTP packet: header and PDU. Both numbers are 0..65535."""
    return _HEADER.pack(*header) + pdu


def decode_a(packet: bytes) -> tuple[BtpA, bytes]:
    """Header and PDU of a BTP-A packet. Raises ProtocolError when it is shorter than its header."""
    return BtpA(*_numbers(packet)), packet[SIZE:]


def decode_b(packet: bytes) -> tuple[BtpB, bytes]:
    """Header and PDU of a BTP-B packet. Raises ProtocolError when it is shorter than its header."""
    return BtpB(*_numbers(packet)), packet[SIZE:]


def _numbers(packet: bytes) -> tuple[int, int]:
    if len(packet) < SIZE:
        raise ProtocolError(f"BTP: {len(packet)} octets are no header of {SIZE}")
    first, second = _HEADER.unpack_from(packet)
    return first, second
