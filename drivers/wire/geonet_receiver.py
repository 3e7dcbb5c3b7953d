"""GeoNetworking in: every header type, secured or not, down to the PDU. EN 302 636-4-1 V1.4.1 (2020-01).

The station is an end: it takes what is meant for it and passes nothing on. This is the hot path, so it unpacks only
what it uses; geonet_packet.py knows every field.
"""

import struct
from collections.abc import Set
from struct import Struct
from typing import NamedTuple

from board.errors import ProtocolError
from drivers.implausible import AHEAD_MS, Implausible, is_outside
from drivers.message import (
    NOT_SECURED,
    Area,
    Ego,
    Position,
    RxInfo,
    Security,
    SecurityStatus,
    Shape,
)
from drivers.reason import Reason
from drivers.wire import btp
from drivers.wire.area import contains
from drivers.wire.geonet_duplicates import Duplicates, Seen
from drivers.wire.geonet_header import BasicNext, CommonNext, HeaderType
from drivers.wire.geonet_own import OwnPackets
from drivers.wire.geonet_packet import EXTENDED
from drivers.wire.security import unwrap

_new = tuple.__new__
_BASIC = Struct(">BxBB")  # version and NH, lifetime, remaining hop limit
_COMMON = Struct(">BBBxHBx")  # NH, HT and HST, traffic class, payload length, maximum hop limit
_SOURCE = Struct(">2x6sIii")  # of a long position vector: MAC, timestamp, latitude, longitude
_NUMBER = Struct(">H")  # sequence number; destination port of BTP-A and BTP-B
_AREA = Struct(">iiHHH")

_BASIC_SIZE, _COMMON_SIZE, _SEQUENCE_SIZE, _LONG_SIZE, _SHORT_SIZE = 4, 8, 4, 24, 20
_BTP = frozenset({CommonNext.BTP_A, CommonNext.BTP_B})

# Timestamps count ms modulo 2**32, 49.7 days (clause 9.5.2): what is further away than half of that looks nearer.
_WRAP = 0xFFFFFFFF
# ms that it may be behind: 6300 s, the longest lifetime (clause 9.6.4), and the same minute.
_BEHIND = _WRAP - 6_300_000 - AHEAD_MS


class Received(NamedTuple):
    """A PDU came, its BTP header removed; rx.btp_port says what it is for."""

    pdu: bytes
    rx: RxInfo


class Heard(NamedTuple):
    """A neighbour showed itself without a PDU: a beacon."""

    mac: bytes


class Asked(NamedTuple):
    """A Location Service request for this station.

    mac       of the station that sent the frame: the first hop of the answer.
    position  of the station that asks: its short position vector, 20 octets.
    """

    mac: bytes
    position: bytes


class Discard(NamedTuple):
    """Nothing came that a user would want. detail: the cause of this one, if more is known than the reason."""

    reason: Reason
    detail: str = ""


class _Form(NamedTuple):
    """What to know of a header type: RxInfo.transport, the octets of common and extended header, and where the
    source position vector begins, both from the common header on.
    """

    transport: str
    size: int
    source: int


_FAMILY = {1: "beacon", 2: "guc", 3: "gac", 4: "gbc", 5: "tsb", 6: "ls"}  # by HT
_SINGLE_HOP = frozenset({HeaderType.SHB, HeaderType.BEACON})  # neither sequence number nor destination


def _form(header_type: int) -> _Form:
    name = "shb" if header_type == HeaderType.SHB else _FAMILY[header_type >> 4]
    source = _COMMON_SIZE if header_type in _SINGLE_HOP else _COMMON_SIZE + _SEQUENCE_SIZE
    return _Form(name, _COMMON_SIZE + EXTENDED[header_type][1], source)


_REASONS = (Implausible.POSITION, Implausible.TIME, Implausible.SOURCE, Implausible.SEQUENCE, Implausible.OWN_ADDRESS)
_FORMS = {int(header_type): _form(header_type) for header_type in EXTENDED}


class Receiver:
    """What comes in for one station. Time goes in as the loop's clock in seconds.

    mac                 own address.
    gn_versions         protocol versions that are accepted.
    deliver_unverified  pass on the PDU of a signed packet, although its signature is not verified.
    own                 packets that the station has sent, and the addresses of its interfaces.
    """

    def __init__(self, mac: bytes, gn_versions: Set[int], deliver_unverified: bool, own: OwnPackets) -> None:
        self._mac = mac
        self._own = own
        self._macs = own.macs
        own.macs.add(mac)
        self._gn_versions = gn_versions
        self._deliver_unverified = deliver_unverified
        self._duplicates = Duplicates()

    def receive(self, packet: bytes, source_mac: bytes, now: float, ego: Ego) -> Received | Heard | Asked | Discard:
        """What a packet brings, from its basic header on. Never raises, whatever the octets.

        source_mac  who sent the frame; of a packet that was passed on, not the one who made it.
        ego         says whether the station is inside the packet's area. Where the own position is not known
                    the area is not looked at: a warning too many is better than one too few. Where the own time is
                    not known (0), the packet's is not looked at.
        """
        try:
            first, lifetime, hop_limit = _BASIC.unpack_from(packet)
        except struct.error:
            return Discard(Reason.TRUNCATED)
        if first >> 4 not in self._gn_versions:
            return Discard(Reason.GN_VERSION)
        if lifetime < 4:  # six bits of multiplier, two of unit
            return Discard(Reason.GN_LIFETIME)
        next_header = first & 15
        if next_header == BasicNext.COMMON:
            return self._common(packet, _BASIC_SIZE, hop_limit, NOT_SECURED, source_mac, now, ego)
        if next_header == BasicNext.SECURED:
            return self._secured(packet, hop_limit, source_mac, now, ego)
        return Discard(Reason.GN_HEADER)

    def _secured(
        self, packet: bytes, hop_limit: int, source_mac: bytes, now: float, ego: Ego
    ) -> Received | Heard | Asked | Discard:
        """The common header and all that follows are the signed payload; the basic header is not signed."""
        try:
            payload, its_aid, ssp = unwrap(packet[_BASIC_SIZE:])
        except ProtocolError as error:
            return Discard(Reason.SECURED_FORMAT, error.message)
        if not self._deliver_unverified:
            return Discard(Reason.SECURED)
        security = Security(SecurityStatus.UNVERIFIABLE_PKT, its_aid, ssp)
        return self._common(payload, 0, hop_limit, security, source_mac, now, ego)

    def _common(
        self,
        packet: bytes,
        at: int,
        hop_limit: int,
        security: Security,
        source_mac: bytes,
        now: float,
        ego: Ego,
    ) -> Received | Heard | Asked | Discard:
        """From the common header on, which begins at an octet of the packet."""
        try:
            next_header, header_type, traffic_class, length, max_hop_limit = _COMMON.unpack_from(packet, at)
            transport, size, source = _FORMS[header_type]
            mac, timestamp, latitude, longitude = _SOURCE.unpack_from(packet, at + source)
        except struct.error:
            return Discard(Reason.TRUNCATED)
        except KeyError:
            return Discard(Reason.GN_NOT_FOR_US if header_type == HeaderType.ANY else Reason.GN_HEADER)
        start = at + size
        end = start + length
        if end > len(packet):
            return Discard(Reason.TRUNCATED)
        is_own = mac in self._macs or source_mac in self._macs
        if is_own and self._own.has(packet[at:end]):
            return Discard(Reason.OWN_ECHO)
        if not 0 < hop_limit <= max_hop_limit:
            return Discard(Reason.GN_HOP_LIMIT)
        area, is_nowhere, is_first_hop, is_other = None, False, True, False
        if header_type != HeaderType.SHB:
            if header_type == HeaderType.BEACON:
                return Discard(Reason.OWN_ADDRESS) if is_own else Heard(source_mac)
            (sequence,) = _NUMBER.unpack_from(packet, at + _COMMON_SIZE)
            seen = self._duplicates.seen(mac, sequence, hash(packet[start:end]), now)
            if seen is Seen.AGAIN:
                return Discard(Reason.GN_DUPLICATE)
            # Who passes a packet on takes 1 from its remaining hop limit, and sends it by an address of its own.
            is_first_hop, is_other = hop_limit == max_hop_limit, seen is Seen.OTHER
            destination = self._destination(header_type, packet, at + source + _LONG_SIZE, ego)
            if destination is None and header_type == HeaderType.LS_REQUEST:
                if is_own:
                    return Discard(Reason.OWN_ADDRESS)
                # A short position vector is the start of a long one (clauses 9.5.2, 9.5.3).
                return Asked(source_mac, packet[at + source : at + source + _SHORT_SIZE])
            if isinstance(destination, Reason):
                return Discard(destination)
            area = destination
            is_nowhere = area is not None and is_outside(*area.centre)
        if next_header >> 4 not in _BTP:
            return Discard(Reason.GN_NEXT_HEADER)
        if length < btp.SIZE:
            return Discard(Reason.TRUNCATED)
        (port,) = _NUMBER.unpack_from(packet, start)
        # tuple.__new__ is what the constructors come to, at half the price.
        position = _new(Position, (latitude, longitude))
        doubts: tuple[Implausible, ...] = ()
        is_off = ego.its_ms and AHEAD_MS < timestamp - ego.its_ms & _WRAP < _BEHIND
        is_between = mac != source_mac and is_first_hop
        if is_nowhere or is_off or is_between or is_other or is_own:
            found = (is_nowhere, is_off, is_between, is_other, is_own)
            doubts = tuple(one for one, is_so in zip(_REASONS, found, strict=True) if is_so)
        rx = _new(
            RxInfo,
            (port, None, 0, traffic_class, hop_limit, security, position, area, source_mac, transport, "", doubts),
        )
        return _new(Received, (packet[start + btp.SIZE : end], rx))

    def _destination(self, header_type: int, packet: bytes, at: int, ego: Ego) -> Area | Reason | None:
        """The area of a packet for us; None where it has none. What says so begins behind the source position."""
        if header_type == HeaderType.TSB:
            return None
        if header_type in (HeaderType.GUC, HeaderType.LS_REQUEST):
            return None if packet[at + 2 : at + 8] == self._mac else Reason.GN_NOT_FOR_US
        if header_type == HeaderType.LS_REPLY:
            return Reason.GN_NOT_FOR_US
        latitude, longitude, distance_a, distance_b, angle = _AREA.unpack_from(packet, at)
        area = Area(Shape(header_type & 15), Position(latitude, longitude), distance_a, distance_b, angle)
        if ego.is_known and not contains(area, ego.position):
            return Reason.GN_OUTSIDE_AREA
        return area
