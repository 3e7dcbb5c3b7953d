"""Destination areas: function F of EN 302 931 V1.1.1 clause 5 over the WGS84 ellipsoid, inside or outside."""

from math import cos, inf, radians, sin, sqrt

from drivers.message import Area, Position, Shape

# WGS84: semi-major axis in metres, and square of the first eccentricity.
_AXIS = 6_378_137.0
_ECCENTRICITY_2 = 6.694_379_990_14e-3

_UNIT = 1e-7  # degrees; unit of positions
_TURN = 3_600_000_000  # 360 degrees, in _UNIT


def contains(area: Area, position: Position) -> bool:
    """Return True if a position lies inside an area or on its border."""
    return function_f(area, position) >= 0


def function_f(area: Area, position: Position) -> float:
    """Return F of EN 302 931: 1 in the centre, 0 on the border, negative outside.

    Without an extent (distance_a or distance_b is 0), an area has no inside: F is minus infinity everywhere.
    distance_b of a circle is ignored.
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
    """Return the distances in metres from the centre: along axis a, and across it.

    Axis a points area.angle degrees east of north.
    """
    north, east = _plane(area.centre, position)
    angle = radians(area.angle)
    return north * cos(angle) + east * sin(angle), east * cos(angle) - north * sin(angle)


def _plane(origin: Position, position: Position) -> tuple[float, float]:
    """Return the metres to the north and to the east from an origin to a position.

    Uses the radii of curvature at the mean latitude: error below 0.1 % at distances up to 65 km.
    """
    latitude = radians((origin.latitude + position.latitude) / 2 * _UNIT)
    # The difference is -180 to 180 degrees: across the 180th meridian if that is shorter.
    turned = (position.longitude - origin.longitude + _TURN // 2) % _TURN - _TURN // 2
    flat = 1 - _ECCENTRICITY_2 * sin(latitude) ** 2
    meridian = _AXIS * (1 - _ECCENTRICITY_2) / (flat * sqrt(flat))
    parallel = _AXIS / sqrt(flat) * cos(latitude)
    north = meridian * radians((position.latitude - origin.latitude) * _UNIT)
    return north, parallel * radians(turned * _UNIT)
