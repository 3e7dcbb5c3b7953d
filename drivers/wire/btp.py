"""Basic Transport Protocol (BTP), EN 302 636-5-1 V2.2.1: a four-octet header with the destination port."""

from struct import Struct
from typing import NamedTuple

from board.runtime.errors import ProtocolError

SIZE = 4  # octets of the header: two 16-bit numbers, clause 7.3.2

_HEADER = Struct(">HH")


class BtpB(NamedTuple):
    """BTP-B header, for non-interactive packet transport, which all ITS messages use.

    port_info  destination port info; 0 means unused.
    """

    destination_port: int
    port_info: int = 0


def encode(header: BtpB, pdu: bytes) -> bytes:
    """Return a BTP packet: the header, then the PDU. Both numbers of the header are 0..65535."""
    return _HEADER.pack(*header) + pdu


def decode_b(packet: bytes) -> tuple[BtpB, bytes]:
    """Return header and PDU of a BTP-B packet. Raises ProtocolError if the packet is shorter than the header."""
    if len(packet) < SIZE:
        raise ProtocolError(f"BTP: truncated header: {len(packet)} of {SIZE} octets")
    return BtpB(*_HEADER.unpack_from(packet)), packet[SIZE:]
