"""Messages of simulated stations: recorded examples, with a few fields replaced.

No codec is needed: in UPER, a field keeps its bit position as long as the fields before it keep their size.
"""

from drivers.message import Position

# CAM of EN 302 637-2 V1.4.1, 46 octets: the example of the public asn1tools package.
_CAM = bytes.fromhex("02029b260aa393e6005a6f0da4ae7bfb35a238230a6a3d4290581a90a3f67e02e6928b37fee9fea6103fdf93d980")

# DENM of EN 302 637-3 V1.3.1, 404 octets: roadworks with a trace of 40 points; the example of C-ITS-Parser.
_DENM = bytes.fromhex(
    "0201e0fd1d37e7465aa8bc8006910d64c90404435932459d59019207135f2142be2be000186a09880050144018030014fb84"
    "3f0a2fdd6bfb00c50a06022d297ff59fffe606805f9c00ff000d3124049be0064802ad89201387001bc0394c328112f801a5"
    "fed56144095fc00d2ffc93110015de00577f46580602c86ffd1bfccec7d80bb77fd59fcdb70e4289fbff7b008f33cc0577e0"
    "0418010d86f0176f0019bfeeeca803a337fc66041e656810fdc002f0021317406d5e004a7ff1d8bf015170037bf862cdf013"
    "d78007a002164a001fdbffd2fff8b2aa0270dffb9800b58e700f9effb33fffec4b813d77ff2dffb362e80af9c000900c1b12"
    "40784dff12808119f003816ff7f401ccc828423f7ffadfffe602c0531c0278ff0ab1100671dffce7ff999fa01daefff44017"
    "2cc880c7f8001a00ee63d80d0abffe0ffdcaec2093d5ff4b7fffd8970d1ab00533fd64c9b80c1d80145fe3b64640545c023c"
    "ff922fee0883e0081801458e2013870052c06acb72015df800a1fff763880671c01d7015d31920577dfff58060d7c0010642"
    "0480600c"
)

# Fields by their first bit and width. Both messages begin with ItsPduHeader: 8 bits protocolVersion, 8 messageID,
# 32 stationID.
_STATION = (16, 32)
# CAM: 16 bits generationDeltaTime; extension bit, 2 presence bits; extension bit, 8 stationType; referencePosition.
_CAM_TIME = (48, 16)
_CAM_LATITUDE = (76, 31)
_CAM_LONGITUDE = (107, 32)
# DENM: 3 presence bits; extension bit, 5 presence bits; actionID, detectionTime, referenceTime, eventPosition
# (termination is absent).
_DENM_STATION = (57, 32)
_DENM_SEQUENCE = (89, 16)
_DENM_DETECTION = (105, 42)
_DENM_REFERENCE = (147, 42)
_DENM_LATITUDE = (189, 31)
_DENM_LONGITUDE = (220, 32)


def cam(station_id: int, its_ms: int, position: Position) -> bytes:
    """Return a CAM of a passenger car at a position and an ITS time in ms."""
    return _patched(
        _CAM,
        (_STATION, station_id),
        (_CAM_TIME, its_ms % 65536),
        (_CAM_LATITUDE, position.latitude + 900_000_000),
        (_CAM_LONGITUDE, position.longitude + 1_800_000_000),
    )


def denm(station_id: int, its_ms: int, position: Position, sequence: int) -> bytes:
    """Return a DENM about roadworks at a position, detected at an ITS time in ms.

    sequence  number of the event, counted by the station.
    """
    return _patched(
        _DENM,
        (_STATION, station_id),
        (_DENM_STATION, station_id),
        (_DENM_SEQUENCE, sequence % 65536),
        (_DENM_DETECTION, its_ms),
        (_DENM_REFERENCE, its_ms),
        (_DENM_LATITUDE, position.latitude + 900_000_000),
        (_DENM_LONGITUDE, position.longitude + 1_800_000_000),
    )


def _patched(octets: bytes, *fields: tuple[tuple[int, int], int]) -> bytes:
    size = len(octets)
    number = int.from_bytes(octets)
    for (start, width), value in fields:
        shift = size * 8 - start - width
        number = number & ~((1 << width) - 1 << shift) | value << shift
    return number.to_bytes(size)
