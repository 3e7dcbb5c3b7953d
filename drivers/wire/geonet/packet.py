"""Codec of whole GeoNetworking packets, with every field of every header type: EN 302 636-4-1 V1.4.1 clause 9.

parse() decodes an unsecured packet, and encode() gives the same octets again. They are for tools, simulators and tests.
The station itself uses receiver.py and sender.py, which process only the fields it needs and are faster.
"""

import struct
from struct import Struct
from typing import NamedTuple, Self

from board.runtime.errors import ProtocolError
from drivers.wire.geonet.header import (
    Address,
    BasicHeader,
    BasicNext,
    CommonHeader,
    HeaderType,
    LongPosition,
    ShortPosition,
)

_LONG_SIZE = 24
_SEQUENCE = Struct(">HH")
_AREA = Struct(">iiHHHH")
_MEDIA = Struct(">I")


class Beacon(NamedTuple):
    """Extended header of a beacon, clause 9.8.6: 24 octets."""

    source: LongPosition

    @classmethod
    def read(cls, octets: bytes, at: int) -> Self:
        return cls(LongPosition.read(octets, at))

    def write(self) -> bytes:
        return self.source.write()


class SingleHop(NamedTuple):
    """Extended header of SHB, clause 9.8.4: 28 octets.

    media  media-dependent data of the access layer (DCC-MCO in ITS-G5, TS 102 636-4-2).
    """

    source: LongPosition
    media: int = 0

    @classmethod
    def read(cls, octets: bytes, at: int) -> Self:
        return cls(LongPosition.read(octets, at), *_MEDIA.unpack_from(octets, at + _LONG_SIZE))

    def write(self) -> bytes:
        return self.source.write() + _MEDIA.pack(self.media)


class MultiHop(NamedTuple):
    """Extended header of TSB, clause 9.8.3: 28 octets."""

    sequence: int
    reserved: int
    source: LongPosition

    @classmethod
    def read(cls, octets: bytes, at: int) -> Self:
        sequence, reserved = _SEQUENCE.unpack_from(octets, at)
        return cls(sequence, reserved, LongPosition.read(octets, at + 4))

    def write(self) -> bytes:
        return _SEQUENCE.pack(self.sequence, self.reserved) + self.source.write()


class Unicast(NamedTuple):
    """Extended header of GUC and LS reply, clauses 9.8.2 and 9.8.8: 48 octets."""

    sequence: int
    reserved: int
    source: LongPosition
    destination: ShortPosition

    @classmethod
    def read(cls, octets: bytes, at: int) -> Self:
        sequence, reserved = _SEQUENCE.unpack_from(octets, at)
        source = LongPosition.read(octets, at + 4)
        return cls(sequence, reserved, source, ShortPosition.read(octets, at + 28))

    def write(self) -> bytes:
        head = _SEQUENCE.pack(self.sequence, self.reserved)
        return head + self.source.write() + self.destination.write()


class GeoArea(NamedTuple):
    """Extended header of GBC and GAC, clause 9.8.5: 44 octets. Distances in metres, angle in degrees from north."""

    sequence: int
    reserved: int
    source: LongPosition
    latitude: int
    longitude: int
    distance_a: int
    distance_b: int
    angle: int
    reserved_2: int = 0

    @classmethod
    def read(cls, octets: bytes, at: int) -> Self:
        sequence, reserved = _SEQUENCE.unpack_from(octets, at)
        source = LongPosition.read(octets, at + 4)
        return cls(sequence, reserved, source, *_AREA.unpack_from(octets, at + 28))

    def write(self) -> bytes:
        head = _SEQUENCE.pack(self.sequence, self.reserved)
        return head + self.source.write() + _AREA.pack(*self[3:])


class LocationRequest(NamedTuple):
    """Extended header of LS request, clause 9.8.7: 36 octets."""

    sequence: int
    reserved: int
    source: LongPosition
    address: Address

    @classmethod
    def read(cls, octets: bytes, at: int) -> Self:
        sequence, reserved = _SEQUENCE.unpack_from(octets, at)
        source = LongPosition.read(octets, at + 4)
        return cls(sequence, reserved, source, Address.read(octets, at + 28))

    def write(self) -> bytes:
        return _SEQUENCE.pack(self.sequence, self.reserved) + self.source.write() + self.address.write()


Extended = Beacon | SingleHop | MultiHop | Unicast | GeoArea | LocationRequest

# Extended header by header type, with its size in octets. ANY has no extended header.
EXTENDED: dict[int, tuple[type[Extended], int]] = {
    HeaderType.BEACON: (Beacon, 24),
    HeaderType.GUC: (Unicast, 48),
    HeaderType.GAC_CIRCLE: (GeoArea, 44),
    HeaderType.GAC_RECTANGLE: (GeoArea, 44),
    HeaderType.GAC_ELLIPSE: (GeoArea, 44),
    HeaderType.GBC_CIRCLE: (GeoArea, 44),
    HeaderType.GBC_RECTANGLE: (GeoArea, 44),
    HeaderType.GBC_ELLIPSE: (GeoArea, 44),
    HeaderType.SHB: (SingleHop, 28),
    HeaderType.TSB: (MultiHop, 28),
    HeaderType.LS_REQUEST: (LocationRequest, 36),
    HeaderType.LS_REPLY: (Unicast, 48),
}


class Packet(NamedTuple):
    """Unsecured packet. extended is None for header type ANY; payload begins with the BTP header."""

    basic: BasicHeader
    common: CommonHeader
    extended: Extended | None
    payload: bytes


def parse(octets: bytes) -> Packet:
    """Decode a packet, given from its basic header on; ignore octets after the payload, such as Ethernet padding.

    Raises ProtocolError for a secured packet, an unknown header type, and truncated headers or payload.
    """
    try:
        basic = BasicHeader.read(octets, 0)
        if basic.next_header == BasicNext.SECURED:
            raise ProtocolError("GeoNetworking: a secured packet has its common header in the signed data")
        common = CommonHeader.read(octets, 4)
        extended, start = _read_extended(octets, common.header_type, 12)
    except struct.error as error:
        raise ProtocolError(f"GeoNetworking: {len(octets)} octets end before their headers do") from error
    payload = octets[start : start + common.payload_length]
    if len(payload) < common.payload_length:
        raise ProtocolError(f"GeoNetworking: {len(payload)} of {common.payload_length} payload octets")
    return Packet(basic, common, extended, payload)


def encode(packet: Packet) -> bytes:
    """Encode a packet exactly from its fields, without correcting lengths or types.

    Raises struct.error for a field that is out of range.
    """
    extended = b"" if packet.extended is None else packet.extended.write()
    return packet.basic.write() + packet.common.write() + extended + packet.payload


def _read_extended(octets: bytes, header_type: int, at: int) -> tuple[Extended | None, int]:
    """Decode the extended header at an index: return it and the index of the payload."""
    if header_type == HeaderType.ANY:
        return None, at
    row = EXTENDED.get(header_type)
    if row is None:
        raise ProtocolError(f"GeoNetworking: header type {header_type:#04x} is in no table of the standard")
    kind, size = row
    return kind.read(octets, at), at + size
