"""GeoNetworking headers: EN 302 636-4-1 V1.4.1 (2020-01), clauses 6.3 and 9.5 to 9.7."""

from enum import IntEnum
from struct import Struct
from typing import NamedTuple, Self


class BasicNext(IntEnum):
    """Next header (NH) of the basic header, clause 9.6.3."""

    ANY = 0
    COMMON = 1
    SECURED = 2


class CommonNext(IntEnum):
    """Next header (NH) of the common header, clause 9.7.3."""

    ANY = 0
    BTP_A = 1
    BTP_B = 2
    IPV6 = 3


class HeaderType(IntEnum):
    """Header type and subtype (HT, HST) of the common header as one octet, clause 9.7.4."""

    ANY = 0x00
    BEACON = 0x10
    GUC = 0x20
    GAC_CIRCLE = 0x30
    GAC_RECTANGLE = 0x31
    GAC_ELLIPSE = 0x32
    GBC_CIRCLE = 0x40
    GBC_RECTANGLE = 0x41
    GBC_ELLIPSE = 0x42
    SHB = 0x50
    TSB = 0x51
    LS_REQUEST = 0x60
    LS_REPLY = 0x61


_BASIC = Struct(">BBBB")
_COMMON = Struct(">BBBBHBB")
_ADDRESS = Struct(">H6s")
_LONG = Struct(">8sIiiHH")
_SHORT = Struct(">8sIii")

# Lifetime, clause 9.6.4: six bits of multiplier, then two bits that select the unit. Units are in seconds.
_UNITS = (0.05, 1.0, 10.0, 100.0)
_MAX_MULTIPLIER = 63


class BasicHeader(NamedTuple):
    """Basic header, clause 9.6: 4 octets. lifetime is the coded octet, see seconds() and lifetime_octet()."""

    version: int
    next_header: int
    reserved: int
    lifetime: int
    hop_limit: int

    @classmethod
    def read(cls, octets: bytes, at: int) -> Self:
        first, *others = _BASIC.unpack_from(octets, at)
        return cls(first >> 4, first & 15, *others)

    def write(self) -> bytes:
        return _BASIC.pack(self.version << 4 | self.next_header, *self[2:])


class CommonHeader(NamedTuple):
    """Common header, clause 9.7: 8 octets. header_type holds HT and HST; bit 0x80 of flags is itsGnIsMobile."""

    next_header: int
    reserved: int
    header_type: int
    traffic_class: int
    flags: int
    payload_length: int
    max_hop_limit: int
    reserved_2: int = 0

    @classmethod
    def read(cls, octets: bytes, at: int) -> Self:
        first, *others = _COMMON.unpack_from(octets, at)
        return cls(first >> 4, first & 15, *others)

    def write(self) -> bytes:
        return _COMMON.pack(self.next_header << 4 | self.reserved, *self[2:])


class Address(NamedTuple):
    """GeoNetworking address (GN_ADDR), clause 6.3.

    is_manual  the M bit: the address was configured manually.
    reserved   10 bits; the country in V1.2.1.
    """

    is_manual: bool
    station_type: int
    reserved: int
    mac: bytes

    @classmethod
    def read(cls, octets: bytes, at: int = 0) -> Self:
        bits, mac = _ADDRESS.unpack_from(octets, at)
        return cls(bool(bits & 0x8000), bits >> 10 & 31, bits & 0x3FF, mac)

    def write(self) -> bytes:
        return _ADDRESS.pack(self.is_manual << 15 | self.station_type << 10 | self.reserved, self.mac)


class LongPosition(NamedTuple):
    """Long position vector, clause 9.5.2: 24 octets.

    timestamp            ms modulo 2**32.
    latitude, longitude  1e-7 degree.
    is_accurate          PAI.
    speed                0.01 m/s, -16384..16383.
    heading              0.1 degree from north.
    """

    address: Address
    timestamp: int
    latitude: int
    longitude: int
    is_accurate: bool
    speed: int
    heading: int

    @classmethod
    def read(cls, octets: bytes, at: int) -> Self:
        address, timestamp, latitude, longitude, bits, heading = _LONG.unpack_from(octets, at)
        speed = (bits & 0x7FFF ^ 0x4000) - 0x4000
        return cls(Address.read(address), timestamp, latitude, longitude, bits > 0x7FFF, speed, heading)

    def write(self) -> bytes:
        bits = self.is_accurate << 15 | self.speed & 0x7FFF
        return _LONG.pack(self.address.write(), self.timestamp, self.latitude, self.longitude, bits, self.heading)


class ShortPosition(NamedTuple):
    """Short position vector, clause 9.5.3: 20 octets."""

    address: Address
    timestamp: int
    latitude: int
    longitude: int

    @classmethod
    def read(cls, octets: bytes, at: int) -> Self:
        address, *others = _SHORT.unpack_from(octets, at)
        return cls(Address.read(address), *others)

    def write(self) -> bytes:
        return _SHORT.pack(self.address.write(), *self[1:])


def seconds(octet: int) -> float:
    """Return the lifetime in seconds for the octet of the basic header, clause 9.6.4: 0.05 .. 6300, or 0."""
    return (octet >> 2) * _UNITS[octet & 3]


def lifetime_octet(lifetime: float) -> int:
    """Return the octet for a lifetime in seconds: the finest unit that can hold it, rounded to the nearest multiple.

    The result is 50 ms to 6300 s, never 0, because receivers discard a packet with lifetime 0.
    """
    for base, unit in enumerate(_UNITS):
        if lifetime < (_MAX_MULTIPLIER + 0.5) * unit:
            return max(1, round(lifetime / unit)) << 2 | base
    return _MAX_MULTIPLIER << 2 | len(_UNITS) - 1
