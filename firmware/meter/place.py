"""Where a sender is: by what the interface knew, else by what a CAM says itself."""

from drivers.message import ITS_HEADER, Position

CAM = 2  # messageID
# Bits of a CAM, in UPER, between its header and referencePosition: generationDeltaTime 16; CamParameters: whether it is
# extended, two containers that may be absent; BasicContainer: whether it is extended, stationType 8. EN 302 637-2
# V1.4.1 and TS 103 900 V2.1.1 have them alike. Then latitude 31 and longitude 32, from their least value on.
_BEFORE, _LATITUDE, _LONGITUDE = 16 + 3 + 9, 31, 32
_LEAST_LATITUDE, _LEAST_LONGITUDE = -900_000_000, -1_800_000_000
_OCTETS = ITS_HEADER + (_BEFORE + _LATITUDE + _LONGITUDE + 7) // 8


def place_of(pdu: bytes, known: Position = Position()) -> Position | None:  # noqa: B008 (it is a tuple)
    """Degrees in 1e-7; None where neither knows. known: of the sender, by its interface; 0, 0 is none."""
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
