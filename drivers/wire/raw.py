"""RawRxMessage of module VC-Container: a received PDU with the properties of its reception, in UPER.

All fields before the payload have a fixed width, so the message is handled as one large number. Fields of whole octets
are packed together; shifts place the others. The bits, in order:

    2    presence of localInfo, presence of payloadString
    128  localInfo, if present: sec 32, usec 32, latitude 32, longitude 32
    464  sec 32, usec 32, rssi 16, dataRate 16, trafficClassID 8, remainHopLimit 8,
         security (status 2, itsAID 22, sspLen 8, ssp 256), latitude 32, longitude 32
    2    type of the area
    96   distanceA 16, distanceB 16, angle 16, sourceMacAddress 48
    11   payloadSize
    11   number of octets of payloadString minus 1, if present; then the payload; zeros up to the next octet

A signed number is encoded as its distance from the lower bound of its range.
"""

import struct
from struct import Struct
from typing import NamedTuple

from board.runtime.errors import ProtocolError
from drivers.message import MAX_PDU, NOT_SECURED, Area, Position, RxInfo, Security, SecurityStatus, Shape

_SIGNED_32 = 1 << 31
_SIGNED_16 = 1 << 15
_MAX_ITS_AID = 2_113_663
_MAX_SSP = 32

_TIME_PLACE = Struct(">IIII")
_RECEPTION = Struct(">IIHHBBI32sII")
_AREA = Struct(">HHH6s")
_SIZES, _SIZE = Struct(">I"), Struct(">H")  # the structs hold the 22 and 11 bits of sizes
_TIME_PLACE_BITS, _RECEPTION_BITS, _AREA_BITS = 128, 464, 96

# Octets of a message without localInfo: those around a payload, including 6 bits of padding after it; and the size of
# a message without payload.
_OVERHEAD, _EMPTY = 74, 72
_LOCAL = 16  # octets that localInfo adds


class RawRx(NamedTuple):
    """Parsed RawRxMessage. The message has no BTP port, no transport and no area centre, so rx has none either."""

    pdu: bytes
    received_ns: int
    rx: RxInfo
    local: tuple[int, Position] | None


def build(pdu: bytes, received_ns: int, rx: RxInfo, local: tuple[int, Position] | None = None) -> bytes:
    """Return the octets of a RawRxMessage. Never raises for a number out of range.

    pdu          0 to 1500 octets. Octets beyond 1500 would be cut off, but the router refuses such PDUs earlier.
    received_ns  Unix time in nanoseconds; truncated to microseconds.
    local        own time (Unix, ns) and position at reception.

    Unknown values are encoded as 0. A number out of range becomes the nearest bound, except an ITS-AID: it becomes 0,
    because the bound would name another service. An SSP of more than 32 octets is left out.
    """
    pdu = pdu[:MAX_PDU]
    size = len(pdu)
    try:
        number = 1 if size else 0
        if local is not None:
            number = (2 | number) << _TIME_PLACE_BITS | _local(*local)
        number = number << _RECEPTION_BITS | _reception(received_ns, rx)
        number = number << _AREA_BITS + 2 | _area(rx)
    except struct.error:
        return build(pdu, *_clamped(received_ns, rx, local))
    overhead = _LOCAL if local is not None else 0
    if not size:
        return (number << 12).to_bytes(_EMPTY + overhead)
    number = (number << 22 | size << 11 | size - 1) << 8 * size | int.from_bytes(pdu)
    return (number << 6).to_bytes(_OVERHEAD + overhead + size)


def _reception(received_ns: int, rx: RxInfo) -> int:
    """Encode the fields from timestamp to positionInfo."""
    seconds, nanoseconds = divmod(received_ns, 1_000_000_000)
    latitude, longitude = rx.position
    word, ssp = (0, b"") if rx.security is NOT_SECURED else _security(rx.security)
    octets = _RECEPTION.pack(
        seconds + _SIGNED_32,
        nanoseconds // 1000 + _SIGNED_32,
        (rx.rssi_dbm or 0) + _SIGNED_16,
        rx.data_rate,
        rx.traffic_class,
        rx.hop_limit,
        word,
        ssp,
        latitude + _SIGNED_32,
        longitude + _SIGNED_32,
    )
    return int.from_bytes(octets)


def _security(security: Security) -> tuple[int, bytes]:
    """Return status, ITS-AID and length of the SSP as one number, and the SSP."""
    its_aid = security.its_aid if 0 <= security.its_aid <= _MAX_ITS_AID else 0
    ssp = security.ssp if len(security.ssp) <= _MAX_SSP else b""
    return security.status << 30 | its_aid << 8 | len(ssp), ssp


def _area(rx: RxInfo) -> int:
    """Encode areaTypeInfo and sourceMacAddress."""
    area = rx.area
    if area is None:
        return int.from_bytes(_AREA.pack(0, 0, 0, rx.source_mac))
    octets = _AREA.pack(area.distance_a, area.distance_b, area.angle, rx.source_mac)
    return area.shape << _AREA_BITS | int.from_bytes(octets)


def _local(own_ns: int, position: Position) -> int:
    seconds, nanoseconds = divmod(own_ns, 1_000_000_000)
    latitude, longitude = position
    octets = _TIME_PLACE.pack(
        seconds + _SIGNED_32,
        nanoseconds // 1000 + _SIGNED_32,
        latitude + _SIGNED_32,
        longitude + _SIGNED_32,
    )
    return int.from_bytes(octets)


def _clamped(
    received_ns: int, rx: RxInfo, local: tuple[int, Position] | None
) -> tuple[int, RxInfo, tuple[int, Position] | None]:
    """Return the arguments with every number limited to its range."""
    area = rx.area
    if area is not None:
        sizes = (_clamp(number, 0, 0xFFFF) for number in (area.distance_a, area.distance_b, area.angle))
        area = Area(area.shape, area.centre, *sizes)
    inside = rx._replace(
        rssi_dbm=_clamp(rx.rssi_dbm or 0, -_SIGNED_16, _SIGNED_16 - 1),
        data_rate=_clamp(rx.data_rate, 0, 0xFFFF),
        traffic_class=_clamp(rx.traffic_class, 0, 0xFF),
        hop_limit=_clamp(rx.hop_limit, 0, 0xFF),
        position=_clamped_position(rx.position),
        area=area,
    )
    own = None if local is None else (_clamped_ns(local[0]), _clamped_position(local[1]))
    return _clamped_ns(received_ns), inside, own


def _clamped_ns(unix_ns: int) -> int:
    return _clamp(unix_ns, -_SIGNED_32 * 1_000_000_000, _SIGNED_32 * 1_000_000_000 - 1)


def _clamped_position(position: Position) -> Position:
    return Position(*(_clamp(number, -_SIGNED_32, _SIGNED_32 - 1) for number in position))


def _clamp(number: int, low: int, high: int) -> int:
    return max(low, min(high, number))


def parse(octets: bytes) -> RawRx:
    """Parse a RawRxMessage; ignore octets after it.

    An rssi of 0 means unknown. Raises ProtocolError if the message is truncated, a number is out of range, or
    payloadSize differs from the size of the payload.
    """
    if not octets:
        raise ProtocolError("RawRxMessage: no octets")
    number = int.from_bytes(octets)
    # The fields are not aligned to octets. Shifted by the two flags, the first fields are aligned. The fields after the
    # type of the area are aligned in `later`.
    fields, later = ((number << bits).to_bytes(len(octets) + 1)[1:] for bits in (2, 4))
    try:
        at = _LOCAL if octets[0] & 0x80 else 0
        local = _parse_local(fields) if at else None
        received_ns, rx = _parse_reception(fields, at)
        at += _RECEPTION.size
        area, mac = _parse_area(fields[at] >> 6, later, at)
        at += _AREA.size
        pdu = _parse_payload(fields, later, at) if octets[0] & 0x40 else _parse_nothing(later, at)
    except (struct.error, IndexError) as error:
        raise ProtocolError(f"RawRxMessage: cut off after {len(octets)} octets") from error
    return RawRx(pdu, received_ns, rx._replace(area=area, source_mac=mac), local)


def _parse_local(fields: bytes) -> tuple[int, Position]:
    seconds, microseconds, latitude, longitude = _TIME_PLACE.unpack_from(fields)
    return _unix_ns(seconds, microseconds), _position(latitude, longitude)


def _parse_reception(fields: bytes, at: int) -> tuple[int, RxInfo]:
    seconds, microseconds, rssi, data_rate, traffic_class, hop_limit, word, ssp, latitude, longitude = (
        _RECEPTION.unpack_from(fields, at)
    )
    its_aid, ssp_size = word >> 8 & 0x3FFFFF, word & 0xFF
    if its_aid > _MAX_ITS_AID or ssp_size > _MAX_SSP:
        raise ProtocolError(f"RawRxMessage: itsAID {its_aid} or sspLen {ssp_size} is out of range")
    security = Security(SecurityStatus(word >> 30), its_aid, ssp[:ssp_size])
    rx = RxInfo(
        rssi_dbm=rssi - _SIGNED_16 or None,
        data_rate=data_rate,
        traffic_class=traffic_class,
        hop_limit=hop_limit,
        security=security,
        position=_position(latitude, longitude),
    )
    return _unix_ns(seconds, microseconds), rx


def _parse_area(area_type: int, later: bytes, at: int) -> tuple[Area | None, bytes]:
    distance_a, distance_b, angle, mac = _AREA.unpack_from(later, at)
    if area_type > Shape.ELLIPSE:
        raise ProtocolError(f"RawRxMessage: unknown type of area: {area_type}")
    if not (area_type or distance_a or distance_b or angle):
        return None, mac
    return Area(Shape(area_type), Position(), distance_a, distance_b, angle), mac


def _parse_payload(fields: bytes, later: bytes, at: int) -> bytes:
    (sizes,) = _SIZES.unpack_from(later, at)
    size, length = sizes >> 21, (sizes >> 10 & 0x7FF) + 1
    if size != length or size > MAX_PDU:
        raise ProtocolError(f"RawRxMessage: payloadSize is {size}, payloadString has {length} octets")
    # The payload follows 22 bits later; with the two bits between `fields` and `later`, that is 3 octets.
    start = at + 3
    if len(fields) * 8 - 2 < (start + size) * 8:
        raise ProtocolError(f"RawRxMessage: cut off before the end of its {size} octets of payload")
    return fields[start : start + size]


def _parse_nothing(later: bytes, at: int) -> bytes:
    (sizes,) = _SIZE.unpack_from(later, at)
    if sizes >> 5:
        raise ProtocolError(f"RawRxMessage: payloadSize is {sizes >> 5}, but payloadString is absent")
    return b""


def _unix_ns(seconds: int, microseconds: int) -> int:
    return (seconds - _SIGNED_32) * 1_000_000_000 + (microseconds - _SIGNED_32) * 1000


def _position(latitude: int, longitude: int) -> Position:
    return Position(latitude - _SIGNED_32, longitude - _SIGNED_32)
