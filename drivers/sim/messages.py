"""Messages of simulated stations: recorded examples, with the fields of their state replaced.

No codec is needed: in UPER, a field keeps its bit position as long as the fields before it keep their size.
"""

from collections.abc import Sequence
from itertools import pairwise
from math import degrees

from drivers.sim.track import Motion

# CAM of EN 302 637-2 V1.4.1, 46 octets: the example of the public asn1tools package. Confidences are those of a good
# receiver; acceleration and steering wheel angle were removed.
_CAM = bytes.fromhex("02029b260aa393e6005a6f0da4ae7bfb35a238230a6a455610581a9123f60902e692800bff01fff8807fff940040")

# DENM of EN 302 637-3 V1.3.1, 402 octets: roadworks with a trace of 40 points; the example of C-ITS-Parser. The points
# of the trace were changed: one second apart, without altitude.
_DENM = bytes.fromhex(
    "0201e0fd1d37e7465aa8bc8006910d64c90404435932459d59019207135f2142be2be00022ab098800501440180300002400"
    "048a2fdd6bfb018e7000c77ff59fffec7380063c00ff000d639c0031e0064802af1ce0018f001bc03958e7000c7801a5fed5"
    "c7380063c00d2ffc9639c0031e00577f4671ce0018effd1bfccf8e7000c77fd59fcdbc7380063bff7b008f639c0031e00418"
    "010f1ce0018f0019bfeef8e7000c77fc66041ec7380063c002f0021639c0031e004a7ff1f1ce0018f0037bf8638e7000c780"
    "07a0021c7380063bffd2fff8e39c0031dffb9800b71ce0018effb33ffff8e7000c77ff2dffb3c7380063c000900c1e39c003"
    "1dff12808131ce0018eff7f401cd8e7000c77ffadfffec7380063c0278ff0ae39c0031dffce7ff9b1ce0018efff4401738e7"
    "000c78001a00eec7380063bffe0ffdce39c0031dff4b7ffff1ce0018f00533fd658e7000c780145fe3bc7380063c023cff92"
    "639c0031e0081801471ce0018f0052c06ad8e7000c7800a1fff7c7380063c01d7015d639c0031dfff58060f1ce0018c20480"
    "600c"
)

# Fields by their first bit and width. Both messages begin with ItsPduHeader: 8 bits protocolVersion, 8 messageID,
# 32 stationID.
_STATION = (16, 32)
# CAM: 16 bits generationDeltaTime; extension bit, 2 presence bits; extension bit, 8 stationType; referencePosition.
_CAM_TIME = (48, 16)
_CAM_LATITUDE = (76, 31)
_CAM_LONGITUDE = (107, 32)
_CAM_ALTITUDE = (175, 20)
# The basicVehicleContainerHighFrequency. Each value is followed by its confidence.
_CAM_HEADING = (208, 12)
_CAM_SPEED = (227, 14)
_CAM_CURVATURE = (285, 11)
_CAM_YAW_RATE = (302, 16)
_CAM_LATERAL = (346, 9)
# DENM: 3 presence bits; extension bit, 5 presence bits; actionID, detectionTime, referenceTime, eventPosition
# (termination is absent).
_DENM_STATION = (57, 32)
_DENM_SEQUENCE = (89, 16)
_DENM_DETECTION = (105, 42)
_DENM_REFERENCE = (147, 42)
_DENM_LATITUDE = (189, 31)
_DENM_LONGITUDE = (220, 32)
_DENM_ALTITUDE = (288, 20)
# The location container, with one trace.
_DENM_HEADING = (390, 12)
_DENM_TRACE = 418  # first bit of the trace
_POINT = 69  # bits of a point: presence bit, deltaLatitude, deltaLongitude, deltaAltitude, pathDeltaTime
TRACE = 40  # points of the trace, one for each second before the event

_MOST_DELTA = 131_071  # largest DeltaLatitude and DeltaLongitude, 1e-7 degree; the next value is "unavailable"


def cam(station_id: int, its_ms: int, motion: Motion) -> bytes:
    """Return a CAM of a passenger car with a motion at an ITS time in ms."""
    speed, curvature = motion.speed_mm_s / 1000, motion.curvature
    return _patched(
        _CAM,
        (_STATION, station_id),
        (_CAM_TIME, its_ms % 65536),
        (_CAM_LATITUDE, motion.latitude + 900_000_000),
        (_CAM_LONGITUDE, motion.longitude + 1_800_000_000),
        (_CAM_ALTITUDE, motion.altitude_mm // 10 + 100_000),
        (_CAM_HEADING, motion.heading_tenths),
        (_CAM_SPEED, min(round(speed * 100), 16_382)),
        (_CAM_CURVATURE, _within(curvature * 1e4, 1022) + 1023),
        (_CAM_YAW_RATE, _within(degrees(speed * curvature) * 100, 32_766) + 32_766),
        (_CAM_LATERAL, _within(speed**2 * curvature * 10, 160) + 160),
    )


def denm(station_id: int, its_ms: int, path: Sequence[Motion], sequence: int) -> bytes:
    """Return a DENM about roadworks at the position of the station, detected at an ITS time in ms.

    path      motion of the station at this time, and at each of the TRACE seconds before it.
    sequence  number of the event, counted by the station.
    """
    here = path[0]
    deltas = [(one.latitude - last.latitude, one.longitude - last.longitude) for last, one in pairwise(path)]
    points = [
        field
        for number, (north, east) in enumerate(deltas)
        for field in (
            ((_DENM_TRACE + number * _POINT + 1, 18), _delta(north)),
            ((_DENM_TRACE + number * _POINT + 19, 18), _delta(east)),
        )
    ]
    return _patched(
        _DENM,
        (_STATION, station_id),
        (_DENM_STATION, station_id),
        (_DENM_SEQUENCE, sequence % 65536),
        (_DENM_DETECTION, its_ms),
        (_DENM_REFERENCE, its_ms),
        (_DENM_LATITUDE, here.latitude + 900_000_000),
        (_DENM_LONGITUDE, here.longitude + 1_800_000_000),
        (_DENM_ALTITUDE, here.altitude_mm // 10 + 100_000),
        (_DENM_HEADING, here.heading_tenths),
        *points,
    )


def _within(value: float, most: int) -> int:
    return max(-most, min(round(value), most))


def _delta(value: int) -> int:
    return (value if abs(value) <= _MOST_DELTA else _MOST_DELTA + 1) + _MOST_DELTA


def _patched(octets: bytes, *fields: tuple[tuple[int, int], int]) -> bytes:
    size = len(octets)
    number = int.from_bytes(octets)
    for (start, width), value in fields:
        shift = size * 8 - start - width
        number = number & ~((1 << width) - 1 << shift) | value << shift
    return number.to_bytes(size)
