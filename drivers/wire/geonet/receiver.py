"""GeoNetworking receiver: every header type, secured or not, down to the PDU. EN 302 636-4-1 V1.4.1 (2020-01).

The station is an end system: it takes the packets addressed to it and forwards none. This is the hot path, so it
unpacks only the fields that it uses; packet.py decodes every field.
"""

import struct
from collections.abc import Callable, Set
from struct import Struct
from typing import NamedTuple

from board.runtime.errors import ProtocolError
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
from drivers.wire.geonet.duplicates import Duplicates, Seen
from drivers.wire.geonet.header import BasicNext, CommonNext, HeaderType
from drivers.wire.geonet.own import OwnPackets
from drivers.wire.geonet.packet import EXTENDED
from drivers.wire.security import unwrap

_new = tuple.__new__
_BASIC = Struct(">BxBB")  # version and NH, lifetime, remaining hop limit
_COMMON = Struct(">BBBxHBx")  # NH, HT and HST, traffic class, payload length, maximum hop limit
_SOURCE = Struct(">2x6sIii")  # start of a long position vector: MAC, timestamp, latitude, longitude
_NUMBER = Struct(">H")  # sequence number; destination port of BTP-A and BTP-B
_AREA = Struct(">iiHHH")

_BASIC_SIZE, _COMMON_SIZE, _SEQUENCE_SIZE, _LONG_SIZE, _SHORT_SIZE = 4, 8, 4, 24, 20
_BTP = frozenset({CommonNext.BTP_A, CommonNext.BTP_B})

# Timestamps count ms modulo 2**32, which is 49.7 days (clause 9.5.2). A time further off than half of that looks
# nearer than it is.
_WRAP = 0xFFFFFFFF
# A timestamp may be up to 6300 s old, the longest lifetime (clause 9.6.4), plus the tolerance AHEAD_MS.
_BEHIND = _WRAP - 6_300_000 - AHEAD_MS


class Received(NamedTuple):
    """Received PDU, without its BTP header; rx.btp_port identifies the type of message."""

    pdu: bytes
    rx: RxInfo


class Heard(NamedTuple):
    """Beacon of a neighbour, which contains no PDU."""

    mac: bytes


class Asked(NamedTuple):
    """Location Service request for this station.

    mac       MAC of the sender of the frame: the first hop of the reply.
    position  short position vector of the requesting station, 20 octets.
    """

    mac: bytes
    position: bytes


class Discard(NamedTuple):
    """Discarded packet.

    detail  specific cause, if more is known than the reason.
    """

    reason: Reason
    detail: str = ""


class _Form(NamedTuple):
    """Layout of a header type.

    transport  RxInfo.transport.
    size       octets of common and extended header together.
    source     offset of the source position vector from the start of the common header.
    """

    transport: str
    size: int
    source: int


_FAMILY = {1: "beacon", 2: "guc", 3: "gac", 4: "gbc", 5: "tsb", 6: "ls"}  # name of the transport by header type (HT)
_SINGLE_HOP = frozenset({HeaderType.SHB, HeaderType.BEACON})  # without sequence number and destination


def _form(header_type: int) -> _Form:
    name = "shb" if header_type == HeaderType.SHB else _FAMILY[header_type >> 4]
    source = _COMMON_SIZE if header_type in _SINGLE_HOP else _COMMON_SIZE + _SEQUENCE_SIZE
    return _Form(name, _COMMON_SIZE + EXTENDED[header_type][1], source)


_REASONS = (Implausible.POSITION, Implausible.TIME, Implausible.SOURCE, Implausible.SEQUENCE, Implausible.OWN_ADDRESS)
_FORMS = {int(header_type): _form(header_type) for header_type in EXTENDED}


class PacketReceiver:
    """GeoNetworking receiver of one station. Times are in seconds of the loop's clock.

    mac                 own address.
    gn_versions         accepted protocol versions.
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

    def receive(
        self, packet: bytes, source_mac: bytes, now: float, its_ms: int, ego: Callable[[], Ego]
    ) -> Received | Heard | Asked | Discard:
        """Process a packet, given from its basic header on. Never raises, whatever the octets.

        source_mac  MAC of the frame's sender; in a forwarded packet, this is the forwarder.
        its_ms      own ITS time. If it is unknown (0), the packet's time is not checked.
        ego         returns the own position; called only for a packet with an area. If the position is unknown, the
                    area is not checked: one warning too many is better than one too few.
        """
        try:
            first, lifetime, hop_limit = _BASIC.unpack_from(packet)
        except struct.error:
            return Discard(Reason.TRUNCATED)
        if first >> 4 not in self._gn_versions:
            return Discard(Reason.GN_VERSION)
        if lifetime < 4:  # the multiplier, in the upper six bits, is 0
            return Discard(Reason.GN_LIFETIME)
        next_header = first & 15
        if next_header == BasicNext.COMMON:
            return self._common(packet, _BASIC_SIZE, hop_limit, NOT_SECURED, source_mac, now, its_ms, ego)
        if next_header == BasicNext.SECURED:
            return self._secured(packet, hop_limit, source_mac, now, its_ms, ego)
        return Discard(Reason.GN_HEADER)

    def _secured(
        self, packet: bytes, hop_limit: int, source_mac: bytes, now: float, its_ms: int, ego: Callable[[], Ego]
    ) -> Received | Heard | Asked | Discard:
        """Open a secured packet: the signed payload begins with the common header. The basic header is not signed."""
        try:
            payload, its_aid, ssp = unwrap(packet[_BASIC_SIZE:])
        except ProtocolError as error:
            return Discard(Reason.SECURED_FORMAT, error.message)
        if not self._deliver_unverified:
            return Discard(Reason.SECURED)
        security = Security(SecurityStatus.UNVERIFIABLE_PKT, its_aid, ssp)
        return self._common(payload, 0, hop_limit, security, source_mac, now, its_ms, ego)

    def _common(
        self,
        packet: bytes,
        at: int,
        hop_limit: int,
        security: Security,
        source_mac: bytes,
        now: float,
        its_ms: int,
        ego: Callable[[], Ego],
    ) -> Received | Heard | Asked | Discard:
        """Process a packet from its common header on, which begins at index `at`."""
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
            # A forwarder decrements the remaining hop limit, and sends the frame with its own source address.
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
        # tuple.__new__ gives the same result as the constructors in half the time.
        position = _new(Position, (latitude, longitude))
        doubts: tuple[Implausible, ...] = ()
        is_off = its_ms and AHEAD_MS < timestamp - its_ms & _WRAP < _BEHIND
        is_between = mac != source_mac and is_first_hop
        if is_nowhere or is_off or is_between or is_other or is_own:
            found = (is_nowhere, is_off, is_between, is_other, is_own)
            doubts = tuple(one for one, is_so in zip(_REASONS, found, strict=True) if is_so)
        rx = _new(
            RxInfo,
            (port, None, 0, traffic_class, hop_limit, security, position, area, source_mac, transport, "", doubts),
        )
        return _new(Received, (packet[start + btp.SIZE : end], rx))

    def _destination(self, header_type: int, packet: bytes, at: int, ego: Callable[[], Ego]) -> Area | Reason | None:
        """Check the destination field, at index `at` after the source position vector.

        Returns the area of a packet for this station (None without an area), or the reason to discard the packet.
        """
        if header_type == HeaderType.TSB:
            return None
        if header_type in (HeaderType.GUC, HeaderType.LS_REQUEST):
            return None if packet[at + 2 : at + 8] == self._mac else Reason.GN_NOT_FOR_US
        if header_type == HeaderType.LS_REPLY:
            return Reason.GN_NOT_FOR_US
        latitude, longitude, distance_a, distance_b, angle = _AREA.unpack_from(packet, at)
        area = Area(Shape(header_type & 15), Position(latitude, longitude), distance_a, distance_b, angle)
        own = ego()
        if own.is_known and not contains(area, own.position):
            return Reason.GN_OUTSIDE_AREA
        return area
