"""Ethernet frame of a GeoNetworking packet: destination, source, EtherType 0x8947 (IEEE registry)."""

from typing import NamedTuple

from drivers.reason import Reason

HEADER = 14  # octets of the Ethernet header
BROADCAST = b"\xff" * 6

_ETHERTYPE = b"\x89\x47"


class Ethernet(NamedTuple):
    """Parsed Ethernet frame; packet begins with the GeoNetworking basic header."""

    destination: bytes
    source: bytes
    packet: bytes


def wrap(source: bytes, packet: bytes, destination: bytes = BROADCAST) -> bytes:
    """Return the Ethernet frame of a packet, without checksum: the link appends it. Addresses have 6 octets."""
    return destination + source + _ETHERTYPE + packet


def unwrap(frame: bytes) -> Ethernet | Reason:
    """Parse an Ethernet frame; return TRUNCATED or NOT_GEONETWORKING if it is invalid."""
    if len(frame) < HEADER:
        return Reason.TRUNCATED
    if frame[12:14] != _ETHERTYPE:
        return Reason.NOT_GEONETWORKING
    return Ethernet(frame[:6], frame[6:12], frame[14:])
