"""Closed track: a vehicle drives along points at a constant speed."""

from bisect import bisect_right
from itertools import accumulate, pairwise
from math import atan2, cos, degrees, hypot, radians
from typing import NamedTuple

METRES = 111_319.5  # metres per degree of latitude, and per degree of longitude at the equator


class Point(NamedTuple):
    """Position in degrees, WGS84; altitude in metres above the ellipsoid."""

    latitude: float
    longitude: float
    altitude_m: float = 0.0


class Motion(NamedTuple):
    """Position and motion of a vehicle: 1e-7 degree, mm, mm/s; heading in 1e-5 degree from north.

    curvature  of the path in 1/m; positive to the left. 0 on a straight line.
    """

    latitude: int
    longitude: int
    altitude_mm: int
    speed_mm_s: int
    heading: int
    curvature: float = 0.0

    @property
    def heading_tenths(self) -> int:
        """Heading in 0.1 degree from north, 0 to 3599."""
        return round(self.heading / 10_000) % 3600


# Lap around a block in Ingolstadt, 1.1 km.
BLOCK = (
    Point(48.7668616, 11.4320680, 420.0),
    Point(48.7692000, 11.4331000, 421.0),
    Point(48.7688000, 11.4369000, 423.0),
    Point(48.7665000, 11.4358000, 421.5),
)


class Track:
    """Closed track along points: the first follows the last. With one point, the vehicle is stationary."""

    def __init__(self, points: tuple[Point, ...] = BLOCK, speed_m_s: float = 13.9) -> None:
        self._points = [*points, points[0]]
        self._speed = speed_m_s if len(points) > 1 else 0.0
        legs = [hypot(*_metres(one, other)) for one, other in pairwise(self._points)]
        self._starts = [0.0, *accumulate(legs)]

    @property
    def length_m(self) -> float:
        """Length of a lap."""
        return self._starts[-1]

    def at(self, seconds: float) -> Motion:
        """Return position and motion at a time after the start."""
        way = seconds * self._speed % self.length_m if self.length_m else 0.0
        leg = min(bisect_right(self._starts, way) - 1, len(self._points) - 2)
        one, other = self._points[leg], self._points[leg + 1]
        length = self._starts[leg + 1] - self._starts[leg]
        part = (way - self._starts[leg]) / length if length else 0.0
        north, east = _metres(one, other)
        return Motion(
            round(_between(one.latitude, other.latitude, part) * 1e7),
            round(_between(one.longitude, other.longitude, part) * 1e7),
            round(_between(one.altitude_m, other.altitude_m, part) * 1000),
            round(self._speed * 1000),
            round(degrees(atan2(east, north)) * 1e5) % 36_000_000,
        )


def _between(one: float, other: float, part: float) -> float:
    return one + (other - one) * part


def _metres(one: Point, other: Point) -> tuple[float, float]:
    """Return the distances to the north and to the east."""
    east = (other.longitude - one.longitude) * cos(radians(one.latitude))
    return (other.latitude - one.latitude) * METRES, east * METRES
