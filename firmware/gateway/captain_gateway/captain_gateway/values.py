"""Parsers of parameter values; an error names the valid values."""

import ipaddress
import math
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from .handlers import KINDS

# RFC 1123, plus the underscore that ZeroMQ accepts
NAME = re.compile(r"[0-9A-Za-z]([0-9A-Za-z._-]{0,251}[0-9A-Za-z])?")
SHAPES = {"circle": 3, "rectangle": 4, "ellipse": 4}  # count of required numbers; one more, if present, is the angle
MOST_DISTANCE, MOST_ANGLE = 65535, 360  # m, degrees from north; EN 302 636-4-1 has 16 bits for each

Read = Callable[[Any], Any]
"""A value as ROS has it to what is kept. Raises ValueError, which says what it may be."""


def boolean(value: object) -> bool:
    """Return true or false. Raises ValueError for any other value."""
    if not isinstance(value, bool):
        raise ValueError(f"{value!r} is neither true nor false")
    return value


def integer(low: int, high: int) -> Read:
    def read(value: object) -> int:
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            raise ValueError(f"{value!r} is not a whole number from {low} to {high}")
        return value

    return read


def number(low: float, high: float) -> Read:
    def read(value: object) -> float:
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
            raise ValueError(f"{value!r} is not a number from {low:g} to {high:g}")
        return float(value)

    return read


def text(value: object) -> str:
    """Return a text. Raises ValueError for any other value."""
    if not isinstance(value, str):
        raise ValueError(f"{value!r} is not a text")
    return value


def host(value: object) -> str:
    """Return a host in the form that ZeroMQ accepts: a name, or an IPv4 or IPv6 address without brackets.

    Raises ValueError for any other text.
    """
    found = text(value)
    if not (_is_address(found) if ":" in found else NAME.fullmatch(found)):
        raise ValueError(f"{found!r} is neither a name nor an address of a host")
    return found


def choice(*words: str) -> Read:
    def read(value: object) -> str:
        if value not in words:
            raise ValueError(f"{value!r} is not one of {', '.join(words)}")
        return str(value)

    return read


def texts(value: object) -> tuple[str, ...]:
    """Return a list of texts. Raises ValueError if it is not a list, or an element is not a text."""
    found = _elements(value)
    if not all(isinstance(one, str) for one in found):
        raise ValueError(f"{found!r} is not a list of texts")
    return tuple(found)


def stations(value: object) -> frozenset[int]:
    """Return stationIDs. Raises ValueError if it is not a list, or an element is not in 0 ... 4294967295."""
    found = _elements(value)
    for one in found:
        if isinstance(one, bool) or not isinstance(one, int) or not 0 <= one <= 0xFFFFFFFF:
            raise ValueError(f"{one!r} is not a stationID; 0 to 4294967295")
    return frozenset(found)


@dataclass(frozen=True)
class Circle:
    """Area in which a message's position must be. Without a centre it is around own position.

    latitude, longitude  of the centre, in degrees.
    """

    radius_m: float
    latitude: float | None = None
    longitude: float | None = None


def circle(value: object) -> Circle | None:
    """Parse [radius_m] or [latitude, longitude, radius_m], in degrees and m; None for an empty list.

    Raises ValueError for other lists, a radius of 0 m or less, and a latitude or longitude out of range.
    """
    found = _numbers(value)
    if not found:
        return None
    if len(found) not in (1, 3) or found[-1] <= 0.0:
        raise ValueError(f"{found!r} is neither [radius_m] nor [latitude, longitude, radius_m]")
    if len(found) == 1:
        return Circle(found[0])
    _check_place(found[0], found[1])
    return Circle(found[2], found[0], found[1])


def area(value: object) -> dict[str, object] | None:
    """Parse `circle LATITUDE LONGITUDE RADIUS`, or `rectangle` or `ellipse` with two distances and an optional angle.

    Positions are in degrees, distances in m, the angle in degrees from north. Returns None for an empty text.
    Raises ValueError for another form, and for a number out of range.
    """
    found = text(value).split()
    if not found:
        return None
    shape, rest = found[0], found[1:]
    if shape not in SHAPES or len(rest) not in (SHAPES[shape], SHAPES[shape] + (shape != "circle")):
        raise ValueError(
            f"{value!r} is neither `circle LATITUDE LONGITUDE RADIUS` nor `rectangle LATITUDE LONGITUDE A B [ANGLE]` "
            "nor that of an ellipse"
        )
    latitude, longitude, *sizes = _numbers([float(one) for one in rest])
    _check_place(latitude, longitude)
    area: dict[str, object] = {"shape": shape, "latitude": latitude, "longitude": longitude}
    limits = {"distance_a": (1, MOST_DISTANCE), "distance_b": (1, MOST_DISTANCE), "angle": (0, MOST_ANGLE)}
    for (name, (low, high)), size in zip(limits.items(), sizes, strict=False):
        area[name] = number = round(size)
        if not low <= number <= high:
            raise ValueError(f"{name}: {size:g} is out of range; {low} to {high}")
    return area


def place(value: object) -> tuple[float, float, float] | None:
    """Parse [latitude, longitude, altitude_m], in degrees and m; None for an empty list.

    Raises ValueError for other lists, and for a latitude or longitude out of range.
    """
    found = _numbers(value)
    if not found:
        return None
    if len(found) != 3:
        raise ValueError(f"{found!r} is not [latitude, longitude, altitude_m]")
    _check_place(found[0], found[1])
    return found[0], found[1], found[2]


def kinds(value: object) -> tuple[str, ...]:
    """Return names of handlers. Raises ValueError for an empty list, an unknown name and a repeated name."""
    found = texts(value)
    if not found:
        raise ValueError(f"the list is empty; choose from {', '.join(KINDS)}")
    unknown = [name for name in found if name not in KINDS]
    if unknown:
        raise ValueError(f"{unknown[0]!r} is not a handler; choose from {', '.join(KINDS)}")
    again = [name for name in found if found.count(name) > 1]
    if again:
        raise ValueError(f"{again[0]!r} is named twice")
    return found


def template(value: object) -> str:
    """Return a topic template. Raises ValueError without {type}: the topics of handlers would be the same."""
    found = text(value)
    if "{type}" not in found:
        raise ValueError(f"{found!r} has no {{type}}, by which the topics of the handlers differ")
    return found


def _is_address(text: str) -> bool:
    try:
        ipaddress.IPv6Address(text)
    except ValueError:
        return False
    return True


def _elements(value: object) -> list[Any]:
    # An empty text means an empty list, because parameter files cannot contain an empty list.
    if value is None or value == "":
        return []
    if isinstance(value, (str, bytes)) or not isinstance(value, Iterable):
        raise ValueError(f"{value!r} is not a list")
    found = list(value)
    return [] if found == [""] else found


def _numbers(value: object) -> list[float]:
    found = _elements(value)
    for one in found:
        if isinstance(one, bool) or not isinstance(one, (int, float)) or not math.isfinite(one):
            raise ValueError(f"{one!r} is not a number")
    return [float(one) for one in found]


def _check_place(latitude: float, longitude: float) -> None:
    if not (-90.0 <= latitude <= 90.0 and -180.0 <= longitude <= 180.0):
        raise ValueError(f"{latitude:g}, {longitude:g} is out of range; latitude -90 to 90, longitude -180 to 180")
