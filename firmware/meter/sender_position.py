"""Position of a sender: from its interface, otherwise from its CAM."""

from drivers.message import ITS_HEADER, Position

CAM = 2  # messageID of a CAM
# Bits of a CAM in UPER between header and referencePosition. generationDeltaTime has 16. CamParameters has 3: one
# extension bit, two presence bits of optional containers. BasicContainer has 9: one extension bit and stationType with
# 8. EN 302 637-2 V1.4.1 and TS 103 900 V2.1.1 are equal here. Latitude (31) and longitude (32) follow, as differences
# from their lowest values.
_BEFORE, _LATITUDE, _LONGITUDE = 16 + 3 + 9, 31, 32
_LEAST_LATITUDE, _LEAST_LONGITUDE = -900_000_000, -1_800_000_000
_OCTETS = ITS_HEADER + (_BEFORE + _LATITUDE + _LONGITUDE + 7) // 8


def position_of(pdu: bytes, known: Position = Position()) -> Position | None:  # noqa: B008 (it is a tuple)
    """Return a sender's position in 1e-7 degree; None if it is unknown.

    known  position given by the interface; 0, 0: unknown.
    """
    if known != (0, 0):
        return known
    if len(pdu) < _OCTETS or pdu[1] != CAM:
        return None
    bits = int.from_bytes(pdu[ITS_HEADER:_OCTETS])
    spare = 8 * (_OCTETS - ITS_HEADER) - _BEFORE - _LATITUDE - _LONGITUDE
    longitude = (bits >> spare & (1 << _LONGITUDE) - 1) + _LEAST_LONGITUDE
    latitude = (bits >> spare + _LONGITUDE & (1 << _LATITUDE) - 1) + _LEAST_LATITUDE
    is_real = abs(latitude) <= -_LEAST_LATITUDE and abs(longitude) <= -_LEAST_LONGITUDE
    return Position(latitude, longitude) if is_real else None
