"""RawRxMessage of module VC-Container: a received PDU with all that is known of its reception, in UPER.

Each field in front of the payload has a fixed width, so the message is one long number: fields of whole octets are
packed side by side, the others put in place by shifts. Its bits, first to last:

    2    localInfo is here, payloadString is here
    128  localInfo, if here: sec 32, usec 32, latitude 32, longitude 32
    464  sec 32, usec 32, rssi 16, dataRate 16, trafficClassID 8, remainHopLimit 8,
         security (status 2, itsAID 22, sspLen 8, ssp 256), latitude 32, longitude 32
    2    type of the area
    96   distanceA 16, distanceB 16, angle 16, sourceMacAddress 48
    11   payloadSize
    11   octets of payloadString less 1, if here; then the payload; zeros to the next octet

Signed numbers stand as their distance from the lower bound of their range.
"""

import struct
from struct import Struct
from typing import NamedTuple

from board.errors import ProtocolError
from drivers.message import MAX_PDU, NOT_SECURED, Area, Position, RxInfo, Security, SecurityStatus, Shape

_SIGNED_32 = 1 << 31
_SIGNED_16 = 1 << 15
_MAX_ITS_AID = 2_113_663
_MAX_SSP = 32

_TIME_PLACE = Struct(">IIII")
_RECEPTION = Struct(">IIHHBBI32sII")
_AREA = Struct(">HHH6s")
_SIZES, _SIZE = Struct(">I"), Struct(">H")  # hold 22 and 11 bits
_TIME_PLACE_BITS, _RECEPTION_BITS, _AREA_BITS = 128, 464, 96

# Octets of a message without localInfo: before a payload, of which 6 bits are the padding behind it, and without one.
_OVERHEAD, _EMPTY = 74, 72
_LOCAL = 16  # octets that localInfo adds


class RawRx(NamedTuple):
    """A RawRxMessage taken apart. rx has no BTP port and no transport, its area no centre: they are not in it."""

    pdu: bytes
    received_ns: int
    rx: RxInfo
    local: tuple[int, Position] | None


def build(pdu: bytes, received_ns: int, rx: RxInfo, local: tuple[int, Position] | None = None) -> bytes:
    """The octets of a RawRxMessage. Never raises for a number out of range.

    pdu          0 to 1500 octets; the router has refused longer ones, of which the rest would be cut off.
    received_ns  Unix time in nanoseconds; cut to microseconds.
    local        own time (Unix, ns) and position on reception.

    What is not known is 0. A number beyond its range becomes the range's bound; an ITS-AID beyond its range
    becomes 0, because the bound would name another service; an SSP of more than 32 octets is left out.
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
    """The fields from timestamp to positionInfo."""
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
    """Status, ITS-AID and the length of the SSP as one number, and the SSP."""
    its_aid = security.its_aid if 0 <= security.its_aid <= _MAX_ITS_AID else 0
    ssp = security.ssp if len(security.ssp) <= _MAX_SSP else b""
    return security.status << 30 | its_aid << 8 | len(ssp), ssp


def _area(rx: RxInfo) -> int:
    """areaTypeInfo and sourceMacAddress."""
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
    """The same with every number inside its range."""
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
    """Take a RawRxMessage apart; octets behind it are left out.

    An rssi of 0 is taken as not known. Raises ProtocolError when it ends too early, holds a number that its type
    does not allow, or a payloadSize that is not the size of its payload.
    """
    if not octets:
        raise ProtocolError("RawRxMessage: no octets")
    number = int.from_bytes(octets)
    # What begins behind the two flags, and what begins behind the area's type, moved to the borders of octets.
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
        raise ProtocolError(f"RawRxMessage: {area_type} is no type of an area")
    if not (area_type or distance_a or distance_b or angle):
        return None, mac
    return Area(Shape(area_type), Position(), distance_a, distance_b, angle), mac


def _parse_payload(fields: bytes, later: bytes, at: int) -> bytes:
    (sizes,) = _SIZES.unpack_from(later, at)
    size, length = sizes >> 21, (sizes >> 10 & 0x7FF) + 1
    if size != length or size > MAX_PDU:
        raise ProtocolError(f"RawRxMessage: payloadSize is {size}, payloadString has {length} octets")
    start = at + 3  # 22 bits later, and fields is two bits behind
    if len(fields) * 8 - 2 < (start + size) * 8:
        raise ProtocolError(f"RawRxMessage: cut off before the end of its {size} octets of payload")
    return fields[start : start + size]


def _parse_nothing(later: bytes, at: int) -> bytes:
    (sizes,) = _SIZE.unpack_from(later, at)
    if sizes >> 5:
        raise ProtocolError(f"RawRxMessage: payloadSize is {sizes >> 5}, but there is no payloadString")
    return b""


def _unix_ns(seconds: int, microseconds: int) -> int:
    return (seconds - _SIGNED_32) * 1_000_000_000 + (microseconds - _SIGNED_32) * 1000


def _position(latitude: int, longitude: int) -> Position:
    return Position(latitude - _SIGNED_32, longitude - _SIGNED_32)
