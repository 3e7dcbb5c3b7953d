"""Circular path: a vehicle drives clockwise at a constant speed."""

from math import cos, degrees, pi, radians, sin
from typing import NamedTuple

from drivers.sim.track import METRES, Motion, Point

_TURN = 36_000_000  # 360 degrees in 1e-5 degree


class Circle(NamedTuple):
    """Circular path.

    start  direction from the centre to the vehicle at time 0, in radians clockwise from north.
    """

    centre: Point
    radius_m: float
    speed_m_s: float
    start: float = 0.0

    def at(self, seconds: float) -> Motion:
        """Return position and motion at a time in seconds; times before 0 are valid too."""
        angle = self.start + seconds * self.speed_m_s / self.radius_m
        north, east = self.radius_m * cos(angle), self.radius_m * sin(angle)
        longitude = self.centre.longitude + east / (METRES * cos(radians(self.centre.latitude)))
        return Motion(
            round((self.centre.latitude + north / METRES) * 1e7),
            round(longitude * 1e7),
            round(self.centre.altitude_m * 1000),
            round(self.speed_m_s * 1000),
            round(degrees(angle + pi / 2) * 1e5) % _TURN,
            -1 / self.radius_m,
        )

    def before(self, seconds: float, count: int) -> list[Motion]:
        """Return the motions at a time and at each of `count` seconds before it, the latest first."""
        return [self.at(seconds - past) for past in range(count + 1)]
