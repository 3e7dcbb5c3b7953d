"""Own position and time: parses the station's reports, converts them for ROS."""

import math
from typing import Any, NamedTuple

from .filters import ITS_EPOCH_S, Place
from .told import number

# Semi-major axis in m and square of the first eccentricity of WGS84 (NIMA TR8350.2).
AXIS_M = 6_378_137.0
ECCENTRICITY_2 = 6.69437999014e-3

MOST_MS = 1_000_000_000_000  # latest accepted ITS time in ms (2035); builtin_interfaces/Time ends in 2038
MOST_M = 1e8  # limit for lengths in m; the farthest GNSS satellites are at 4e7 m
# Plausible ranges of the fields of Pose. A value outside counts as unknown.
LIMITS = {
    "latitude": (-90.0, 90.0),
    "longitude": (-180.0, 180.0),
    "altitude_m": (-MOST_M, MOST_M),
    "horizontal_m": (0.0, MOST_M),
    "vertical_m": (0.0, MOST_M),
    "heading_deg": (-360.0, 360.0),
    "speed_m_s": (0.0, MOST_M),
}


class Pose(NamedTuple):
    """Own position in degrees, m and m/s; None if unknown.

    horizontal_m, vertical_m  accuracy.
    source   an interface, or `configured`.
    carrier  use of carrier phases: none, float, fixed.
    """

    latitude: float
    longitude: float
    altitude_m: float | None
    horizontal_m: float | None
    vertical_m: float | None
    heading_deg: float | None
    speed_m_s: float | None
    source: str
    carrier: str


def pose(status: dict[str, Any]) -> Pose | None:
    """Return the position from a status report; None if the station does not know it."""
    told = status.get("position")
    if not isinstance(told, dict):
        return None
    latitude, longitude, altitude_m, horizontal_m, vertical_m, heading_deg, speed_m_s = (
        number(told, name, *limits) for name, limits in LIMITS.items()
    )
    source = str(told.get("source") or "")
    if latitude is None or longitude is None or not source:
        return None
    return Pose(
        latitude, longitude, altitude_m, horizontal_m, vertical_m, heading_deg, speed_m_s, source,
        str(told.get("carrier") or ""),
    )  # fmt: skip


class Clock(NamedTuple):
    """The station's own time.

    unix_ns  Unix time in ns of the report; None if the station does not know it.
    """

    unix_ns: int | None
    source: str
    leap_seconds: int | None


def clock(time: dict[str, Any]) -> Clock:
    """Return the time from a report `time.` of the station."""
    leap = time.get("leap")
    seconds = leap.get("seconds") if isinstance(leap, dict) else None
    leap_seconds = seconds if isinstance(seconds, int) and 0 <= seconds < 100 else None
    its_ms = time.get("its_ms")
    unix_ns = None
    if isinstance(its_ms, int) and 0 <= its_ms < MOST_MS and leap_seconds is not None:
        unix_ns = (its_ms - leap_seconds * 1000 + ITS_EPOCH_S * 1000) * 1_000_000
    return Clock(unix_ns, f"{time.get('receiver') or 'system'}, {time.get('state') or 'unknown'}", leap_seconds)


def east_north_up(origin: tuple[float, float, float], place: Place, altitude_m: float) -> tuple[float, float, float]:
    """Return a place as east, north, up in m from an origin (axes of REP 103).

    origin  latitude and longitude in degrees, altitude in m.
    """
    latitude, longitude = math.radians(origin[0]), math.radians(origin[1])
    away = tuple(a - b for a, b in zip(_ecef(*place, altitude_m), _ecef(*origin), strict=True))
    east = -math.sin(longitude) * away[0] + math.cos(longitude) * away[1]
    outward = math.cos(longitude) * away[0] + math.sin(longitude) * away[1]
    return (
        east,
        -math.sin(latitude) * outward + math.cos(latitude) * away[2],
        math.cos(latitude) * outward + math.sin(latitude) * away[2],
    )


def quaternion(heading_deg: float) -> tuple[float, float]:
    """Return z and w of the rotation about the vertical axis.

    heading_deg counts clockwise from north; yaw in ROS counts counterclockwise from east (REP 103).
    """
    yaw = math.radians(90.0 - heading_deg)
    return math.sin(yaw / 2), math.cos(yaw / 2)


def _ecef(latitude_deg: float, longitude_deg: float, altitude_m: float) -> tuple[float, float, float]:
    latitude, longitude = math.radians(latitude_deg), math.radians(longitude_deg)
    radius = AXIS_M / math.sqrt(1 - ECCENTRICITY_2 * math.sin(latitude) ** 2)
    across = (radius + altitude_m) * math.cos(latitude)
    upward = (radius * (1 - ECCENTRICITY_2) + altitude_m) * math.sin(latitude)
    return across * math.cos(longitude), across * math.sin(longitude), upward
