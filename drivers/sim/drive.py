"""A simulated drive around a block of houses, past a station that stands at one of its corners.

The block is 100 m wide and 250 m long. The car drives in the middle of the streets around it, 10 m from its walls;
the other station stands where the streets in the south and in the west meet. It sees all of these two streets; what
the car sends from the other two passes through the block, or through one of its corners. What that costs is in
drivers/sim/radio/path.h; with the numbers of RADIO the car is lost behind the block, and sometimes near it.
"""

from math import cos, radians

from drivers.message import Position
from drivers.sim.track import METRES, Motion, Point, Track

WIDTH_M, LENGTH_M = 100.0, 250.0  # east, north
STREET_M = 10.0  # from a wall to the middle of the street
SPEED_M_S = 30 / 3.6
ALTITUDE_M = 420.0
# ETSI EN 302 571 allows 33 dBm; 23 dBm is what stations usually send CAMs with. -92 dBm is a good receiver's
# at 6 Mbit/s, of which IEEE 802.11-2020 Table 17-18 asks -85 dBm.
RADIO = "power=23 fading=3 sensitivity=-92"

_WEST_SOUTH = Point(48.7668616, 11.4320680, ALTITUDE_M)  # of the block; the same street as drivers/sim/track.py


def place(east_m: float, north_m: float) -> Point:
    """So far from the block's corner in the south-west."""
    of_longitude = METRES * cos(radians(_WEST_SOUTH.latitude))
    latitude = _WEST_SOUTH.latitude + north_m / METRES
    return Point(latitude, _WEST_SOUTH.longitude + east_m / of_longitude, ALTITUDE_M)


PARKED = place(-STREET_M, -STREET_M)
CORNERS = (
    PARKED,
    place(WIDTH_M + STREET_M, -STREET_M),
    place(WIDTH_M + STREET_M, LENGTH_M + STREET_M),
    place(-STREET_M, LENGTH_M + STREET_M),
)


def drive(speed_m_s: float = SPEED_M_S) -> Track:
    """Round and round: east, north, west and south, 780 m; the first corner is where the other station stands."""
    return Track(CORNERS, speed_m_s)


def radio(extra: str = "") -> str:
    """Words for both radios (drivers/sim/radio/settings.h): their strength, and the block between them."""
    corner, opposite = fixed(place(0, 0)), fixed(place(WIDTH_M, LENGTH_M))
    return f"{RADIO} buildings={':'.join(map(str, (*corner, *opposite)))} {extra}".strip()


def at(where: Point | Motion) -> str:
    """Words that put a radio there."""
    position = fixed(where) if isinstance(where, Point) else Position(where.latitude, where.longitude)
    return f"position={position.latitude}:{position.longitude}"


def fixed(point: Point) -> Position:
    """In 1e-7 degree."""
    return Position(round(point.latitude * 1e7), round(point.longitude * 1e7))
