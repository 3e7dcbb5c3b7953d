"""The Basic Transport Protocol, EN 302 636-5-1 V2.2.1: four octets that say which message follows."""

from struct import Struct
from typing import NamedTuple

from board.errors import ProtocolError

SIZE = 4  # octets of the header: two 16-bit numbers, clause 7.3.2

_HEADER = Struct(">HH")


class BtpB(NamedTuple):
    """Header of transport that needs no answer: what ITS messages use. port_info 0 is "not used"."""

    destination_port: int
    port_info: int = 0


def encode(header: BtpB, pdu: bytes) -> bytes:
    """A BTP packet: header and PDU. Both numbers are 0..65535."""
    return _HEADER.pack(*header) + pdu


def decode_b(packet: bytes) -> tuple[BtpB, bytes]:
    """Header and PDU of a BTP-B packet. Raises ProtocolError when it is shorter than its header."""
    if len(packet) < SIZE:
        raise ProtocolError(f"BTP: {len(packet)} octets are no header of {SIZE}")
    return BtpB(*_HEADER.unpack_from(packet)), packet[SIZE:]
