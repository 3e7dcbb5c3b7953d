"""Simulated drive around a block of houses, past a station at one corner.

The block is 100 m wide and 250 m long. The car drives in the middle of the streets around it, 10 m from its walls. The
other station is at the south-west corner, with a line of sight along the southern and western streets. Frames from the
other two streets pass through the block or one of its corners; drivers/sim/radio/path.h computes their loss. With the
settings of RADIO the car is out of range behind the block, and sometimes near it.
"""

from math import cos, radians

from drivers.message import Position
from drivers.sim.track import METRES, Motion, Point, Track

WIDTH_M, LENGTH_M = 100.0, 250.0  # extent to the east and to the north
STREET_M = 10.0  # distance from a wall to the middle of the street
SPEED_M_S = 30 / 3.6
ALTITUDE_M = 420.0
# ETSI EN 302 571 allows 33 dBm; stations usually send CAMs with 23 dBm. A good receiver has a sensitivity of -92 dBm
# at 6 Mbit/s; IEEE 802.11-2020 Table 17-18 requires -85 dBm.
RADIO = "power=23 fading=3 sensitivity=-92"

# The block's south-west corner, in the same street as drivers/sim/track.py.
_WEST_SOUTH = Point(48.7668616, 11.4320680, ALTITUDE_M)


def point_at(east_m: float, north_m: float) -> Point:
    """Return the point at these distances from the block's south-west corner."""
    of_longitude = METRES * cos(radians(_WEST_SOUTH.latitude))
    latitude = _WEST_SOUTH.latitude + north_m / METRES
    return Point(latitude, _WEST_SOUTH.longitude + east_m / of_longitude, ALTITUDE_M)


PARKED = point_at(-STREET_M, -STREET_M)
CORNERS = (
    PARKED,
    point_at(WIDTH_M + STREET_M, -STREET_M),
    point_at(WIDTH_M + STREET_M, LENGTH_M + STREET_M),
    point_at(-STREET_M, LENGTH_M + STREET_M),
)


def drive(speed_m_s: float = SPEED_M_S) -> Track:
    """Return the closed track east, north, west and south, 780 m long. It starts at the corner of the other station."""
    return Track(CORNERS, speed_m_s)


def radio(extra: str = "") -> str:
    """Return the settings of both radios (drivers/sim/radio/settings.h): signal strength, and the block."""
    corner, opposite = fixed(point_at(0, 0)), fixed(point_at(WIDTH_M, LENGTH_M))
    return f"{RADIO} buildings={':'.join(map(str, (*corner, *opposite)))} {extra}".strip()


def at(where: Point | Motion) -> str:
    """Return the setting for a radio's position."""
    position = fixed(where) if isinstance(where, Point) else Position(where.latitude, where.longitude)
    return f"position={position.latitude}:{position.longitude}"


def fixed(point: Point) -> Position:
    """Return a point in units of 1e-7 degree."""
    return Position(round(point.latitude * 1e7), round(point.longitude * 1e7))
