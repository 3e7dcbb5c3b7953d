"""Is a place inside a destination area? Function F of EN 302 931 V1.1.1 clause 5 over the WGS84 ellipsoid."""

from math import cos, inf, radians, sin, sqrt

from drivers.message import Area, Position, Shape

# WGS84: semi-major axis in metres, square of the first eccentricity.
_AXIS = 6_378_137.0
_ECCENTRICITY_2 = 6.694_379_990_14e-3

_UNIT = 1e-7  # degree
_TURN = 3_600_000_000  # 360 degrees in that unit


def contains(area: Area, position: Position) -> bool:
    """Whether a position lies inside an area or on its border."""
    return function_f(area, position) >= 0


def function_f(area: Area, position: Position) -> float:
    """F of EN 302 931: 1 in the centre, 0 on the border, negative outside.

    An area without extent (a distance of 0) has no inside: minus infinity everywhere. distance_b of a circle
    is not looked at.
    """
    along, across = _offset(area, position)
    a = area.distance_a
    b = a if area.shape is Shape.CIRCLE else area.distance_b
    if not a or not b:
        return -inf
    if area.shape is Shape.RECTANGLE:
        return min(1 - (along / a) ** 2, 1 - (across / b) ** 2)
    return 1 - (along / a) ** 2 - (across / b) ** 2


def _offset(area: Area, position: Position) -> tuple[float, float]:
    """Metres from the centre along axis a, which points angle degrees east of north, and across it."""
    north, east = _plane(area.centre, position)
    angle = radians(area.angle)
    return north * cos(angle) + east * sin(angle), east * cos(angle) - north * sin(angle)


def _plane(origin: Position, position: Position) -> tuple[float, float]:
    """Metres to the north and east of an origin, by the radii of curvature half-way: to 0.1 % in 65 km."""
    latitude = radians((origin.latitude + position.latitude) / 2 * _UNIT)
    turned = (position.longitude - origin.longitude + _TURN // 2) % _TURN - _TURN // 2  # the shorter way round
    flat = 1 - _ECCENTRICITY_2 * sin(latitude) ** 2
    meridian = _AXIS * (1 - _ECCENTRICITY_2) / (flat * sqrt(flat))
    parallel = _AXIS / sqrt(flat) * cos(latitude)
    north = meridian * radians((position.latitude - origin.latitude) * _UNIT)
    return north, parallel * radians(turned * _UNIT)
