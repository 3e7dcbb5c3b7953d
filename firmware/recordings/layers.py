"""Layers of a captured frame, from link to PDU. Signatures are not verified.

Frames inside UDP datagrams, which stations without radio exchange, are opened as well. A station's receiver discards
packets that are old, repeated or for others; this module opens all of them.
"""

from collections.abc import Callable
from struct import Struct
from typing import NamedTuple

from drivers.wire import btp, security
from drivers.wire.geonet import packet as geonet_packet
from drivers.wire.geonet.header import BasicNext, CommonNext, HeaderType

GEONETWORKING = 0x8947  # EtherType, IEEE registry
VLAN, IPV4, IPV6 = 0x8100, 0x0800, 0x86DD
UDP = b"\x11"  # protocol (RFC 791), next header (RFC 8200)
IPV6_HEADER, UDP_HEADER = 40, 8  # octets
BASIC = 4  # octets of the basic header

_NUMBER = Struct(">H")
_SNAP = b"\xaa\xaa\x03\x00\x00\x00"  # LLC and SNAP headers before an EtherType: IEEE 802.2, RFC 1042
_NO_MESSAGE = {
    HeaderType.BEACON: "beacons",
    HeaderType.LS_REQUEST: "location service",
    HeaderType.LS_REPLY: "location service",
}


class Carried(NamedTuple):
    """A PDU, with the packet that carried it.

    transport  header type of GeoNetworking: shb, gbc_circle, tsb, ...
    is_signed  the packet was secured; its signature is not verified.
    """

    pdu: bytes
    btp_port: int
    transport: str
    is_signed: bool

    def __str__(self) -> str:
        return f"{'signed ' if self.is_signed else ''}{self.transport}, BTP port {self.btp_port}"


class NoMessage(NamedTuple):
    """Valid frame without a message; what: its kind, as text."""

    what: str


def open_frame(link: int, frame: bytes) -> Carried | NoMessage:
    """Open a frame of a LINKTYPE_ value and return its PDU. Raises ProtocolError for malformed GeoNetworking or BTP."""
    packet = packet_of(link, frame)
    return packet if isinstance(packet, NoMessage) else open_packet(packet)


def packet_of(link: int, frame: bytes) -> bytes | NoMessage:
    """Return the unparsed GeoNetworking packet in a frame of a LINKTYPE_ value, from its basic header on."""
    way = _LINKS.get(link)
    if way is None:
        return NoMessage(f"with unsupported link type {link}")
    packet = way(frame)
    if packet is None and link in _MAY_HOLD_IP:
        packet = _ethernet(_udp_payload(frame, _MAY_HOLD_IP[link]))
    return NoMessage("not GeoNetworking") if packet is None else packet


def open_packet(packet: bytes) -> Carried | NoMessage:
    """Return the PDU of a GeoNetworking packet, which starts at its basic header.

    Raises ProtocolError if it is malformed.
    """
    is_signed = bool(packet) and packet[0] & 15 == BasicNext.SECURED
    if is_signed:
        # The signed payload is the common header and all that follows. Joined with the basic header, it is an unsecured
        # packet.
        inside = security.unwrap(packet[BASIC:]).payload
        packet = bytes([packet[0] & 0xF0 | BasicNext.COMMON]) + packet[1:BASIC] + inside
    parsed = geonet_packet.parse(packet)
    kind = HeaderType(parsed.common.header_type)
    if kind in _NO_MESSAGE:
        return NoMessage(_NO_MESSAGE[kind])
    if parsed.common.next_header not in (CommonNext.BTP_A, CommonNext.BTP_B):
        return NoMessage(f"GeoNetworking with next header {parsed.common.next_header}, not BTP")
    # The destination port is the first field in BTP-A as well.
    transport, pdu = btp.decode_b(parsed.payload)
    return Carried(pdu, transport.destination_port, kind.name.lower(), is_signed)


def link_of(octets: bytes) -> int | None:
    """Return the LINKTYPE_ of a frame with GeoNetworking or radiotap; None for a PDU and for other frames.

    An ITS PDU begins with a small protocolVersion and a nonzero messageID. Only Ethernet frames may begin the same way.
    """
    if is_radiotap(octets):
        return RADIOTAP
    for link, is_possible in _FIRST_OCTETS.items():
        if is_possible(octets) and _LINKS[link](octets) is not None:
            return link
    return None


def is_radiotap(octets: bytes) -> bool:
    """Whether the octets begin with a radiotap header, followed by IEEE 802.11.

    Source: radiotap.org: version and padding 0, length, bitmaps.
    """
    length = int.from_bytes(octets[2:4], "little")
    if octets[:2] != b"\0\0" or not RADIOTAP_HEADER <= length <= len(octets) - WLAN_HEADER:
        return False
    bitmaps = 4
    while bitmaps < length and octets[bitmaps + 3] & 0x80:  # this bit announces another bitmap
        bitmaps += 4
    return bitmaps + 4 <= length and not octets[length] & 3


# -- link layers (tcpdump.org/linktypes.html): each returns the GeoNetworking packet of a frame, or None


def _ethernet(frame: bytes) -> bytes | None:
    return _after_ethertype(frame, 12)


def _after_ethertype(frame: bytes, at: int) -> bytes | None:
    """Return the payload of GeoNetworking after an EtherType, or after one VLAN tag (IEEE 802.1Q); None without it."""
    if _number(frame, at) == VLAN:
        at += 4
    return frame[at + 2 :] if _number(frame, at) == GEONETWORKING else None


def _number(frame: bytes, at: int) -> int:
    return _NUMBER.unpack_from(frame, at)[0] if len(frame) >= at + 2 else -1


def _cooked(frame: bytes) -> bytes | None:
    return _after_ethertype(frame, 14)


def _cooked_2(frame: bytes) -> bytes | None:
    return frame[20:] if _number(frame, 0) == GEONETWORKING else None


def _radiotap(frame: bytes) -> bytes | None:
    """Skip the radiotap header, whose length is in octets 2 and 3, little-endian."""
    return _wlan(frame[int.from_bytes(frame[2:4], "little") :]) if len(frame) >= 4 else None


def _wlan(frame: bytes) -> bytes | None:
    """Open a data frame of IEEE 802.11-2020 clause 9.2.3.

    It has four addresses if both DS bits are set, and two octets of QoS if its subtype says so.
    """
    # Neither other frame types nor encrypted frames are opened.
    if len(frame) < 2 or frame[0] & 0x0C != 0x08 or frame[1] & 0x40:
        return None
    at = 24 + 6 * (frame[1] & 3 == 3) + 2 * bool(frame[0] & 0x80)
    return _after_ethertype(frame, at + len(_SNAP)) if frame[at : at + len(_SNAP)] == _SNAP else None


def _udp_payload(frame: bytes, at: int) -> bytes:
    """Return the payload of a UDP datagram, given the octet of its EtherType; empty for other frames.

    Stations without radio send whole frames there.
    """
    ethertype, at = _number(frame, at), at + 2
    if ethertype == IPV4 and frame[at + 9 : at + 10] == UDP:
        return frame[at + 4 * (frame[at] & 15) + UDP_HEADER :]
    if ethertype == IPV6 and frame[at + 6 : at + 7] == UDP:
        return frame[at + IPV6_HEADER + UDP_HEADER :]
    return b""


RADIOTAP = 127
NAMES = {1: "Ethernet", 105: "802.11", 113: "Linux cooked", RADIOTAP: "radiotap", 276: "Linux cooked"}
RADIOTAP_HEADER, WLAN_HEADER = 8, 10  # smallest headers in octets; for 802.11, that of an acknowledgement

# Tests of the first octets, by link type: any address; a data frame of version 0; a packet type; an EtherType.
_FIRST_OCTETS: dict[int, Callable[[bytes], bool]] = {
    1: lambda octets: True,
    105: lambda octets: octets[:1] != b"" and octets[0] & 0x0F == 0x08,
    113: lambda octets: octets[:1] == b"\0" and octets[1:2] <= b"\4",
    276: lambda octets: octets[:1] == b"\x89",
}
_MAY_HOLD_IP = {1: 12, 113: 14}  # link type -> octet of its EtherType
_LINKS: dict[int, Callable[[bytes], bytes | None]] = {
    1: _ethernet,
    105: _wlan,
    113: _cooked,
    RADIOTAP: _radiotap,
    276: _cooked_2,
}
