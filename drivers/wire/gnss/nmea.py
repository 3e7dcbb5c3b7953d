"""NMEA 0183 sentences of GNSS receivers: GGA, RMC, GSA, VTG and ZDA of any talker.

    $GNGGA,094503.00,4846.01170,N,01125.92330,E,4,18,0.62,376.2,M,46.6,M,1.0,0000*5A CR LF

The body is between `$` and `*`: talker and formatter, then fields separated by commas; fields may be empty. After `*`
comes the checksum, the exclusive or of the body's octets, as two hexadecimal digits. The line may end with LF alone.
Source: NMEA 0183 V4.11, clauses 5.3 and 6.2; u-blox F9 HPG 1.32 interface description, clause 2.
"""

import re
from collections.abc import Callable, Sequence
from functools import reduce
from operator import xor
from typing import NamedTuple

from board.runtime.errors import ProtocolError


class Sentence(NamedTuple):
    """Complete sentence; body is the text between `$` and `*`."""

    body: str


class Clock(NamedTuple):
    """UTC time of day; second may be 60."""

    hour: int
    minute: int
    second: int
    nanosecond: int


class Gga(NamedTuple):
    """Position and its quality: 0 none, 1 autonomous, 2 differential, 4 RTK fixed, 5 RTK float, 6 dead reckoning.

    latitude, longitude  1e-7 degree.
    altitude_mm          above mean sea level, mm.
    separation_mm        of the geoid from the ellipsoid, mm.
    """

    clock: Clock | None
    latitude: int | None
    longitude: int | None
    quality: int
    satellites: int | None
    hdop: float | None
    altitude_mm: int | None
    separation_mm: int | None


class Rmc(NamedTuple):
    """Recommended minimum data: time and date, position, velocity. speed in mm/s, course in 1e-5 degree."""

    clock: Clock | None
    is_valid: bool
    latitude: int | None
    longitude: int | None
    speed_mm_s: int | None
    course: int | None
    date: tuple[int, int, int] | None  # year, month, day


class Gsa(NamedTuple):
    """Kind of the fix: 1 none, 2 two-dimensional, 3 three-dimensional."""

    fix: int
    hdop: float | None


class Vtg(NamedTuple):
    """Velocity: course over ground in 1e-5 degree, speed in mm/s."""

    course: int | None
    speed_mm_s: int | None


class Zda(NamedTuple):
    """Time and date."""

    clock: Clock | None
    date: tuple[int, int, int] | None


Message = Gga | Rmc | Gsa | Vtg | Zda


def checksum(body: bytes) -> int:
    """Return the exclusive or of all octets between `$` and `*`."""
    return reduce(xor, body, 0)


def encode(body: str) -> bytes:
    """Return the octets of a sentence with this body."""
    octets = body.encode("ascii")
    return b"$%b*%02X\r\n" % (octets, checksum(octets))


def decode(sentence: Sentence) -> Message | None:
    """Decode a sentence; return None for other formatters and for proprietary sentences.

    Raises ProtocolError for missing or invalid fields.
    """
    address, *fields = sentence.body.split(",")
    found = None if address.startswith("P") else _FORMATTERS.get(address[2:])
    if found is None:
        return None
    count, read = found
    if len(fields) < count:
        raise ProtocolError(f"{address} with {len(fields)} fields: it has {count}")
    try:
        return read(fields)
    except ValueError as error:
        raise ProtocolError(f"{address}: {error}") from error


def _gga(fields: Sequence[str]) -> Gga:
    clock, latitude, north, longitude, east, quality, satellites, hdop, altitude, _, separation = fields[:11]
    return Gga(
        _clock(clock),
        _angle(latitude, north, "NS", 90),
        _angle(longitude, east, "EW", 180),
        _whole(quality) or 0,
        _whole(satellites),
        _real(hdop),
        _scaled(altitude, 1000),
        _scaled(separation, 1000),
    )


def _rmc(fields: Sequence[str]) -> Rmc:
    clock, status, latitude, north, longitude, east, speed, course, date = fields[:9]
    return Rmc(
        _clock(clock),
        status == "A",
        _angle(latitude, north, "NS", 90),
        _angle(longitude, east, "EW", 180),
        _scaled(speed, KNOT),
        _scaled(course, 100_000),
        _date(date),
    )


def _gsa(fields: Sequence[str]) -> Gsa:
    return Gsa(_whole(fields[1]) or 1, _real(fields[15]))


def _vtg(fields: Sequence[str]) -> Vtg:
    return Vtg(_scaled(fields[0], 100_000), _scaled(fields[6], KILOMETRE_PER_HOUR))


def _zda(fields: Sequence[str]) -> Zda:
    clock, day, month, year = fields[:4]
    date = (int(year), int(month), int(day)) if year and month and day else None
    return Zda(_clock(clock), date)


# Smallest number of fields and parser of each formatter.
_FORMATTERS: dict[str, tuple[int, Callable[[Sequence[str]], Message]]] = {
    "GGA": (11, _gga),
    "RMC": (9, _rmc),
    "GSA": (17, _gsa),
    "VTG": (8, _vtg),
    "ZDA": (4, _zda),
}

KNOT = 1852 / 3.6  # a knot in mm/s
KILOMETRE_PER_HOUR = 1000 / 3.6  # a kilometre per hour in mm/s

_NUMBER = re.compile(r"-?[0-9]{1,10}(\.[0-9]{0,10})?")
_CLOCK = re.compile(r"([01][0-9]|2[0-3])([0-5][0-9])([0-5][0-9]|60)(?:\.([0-9]{1,9}))?")
_ANGLE = re.compile(r"([0-9]{1,3})([0-5][0-9])(?:\.([0-9]{1,9}))?")
_DATE = re.compile(r"([0-3][0-9])([01][0-9])([0-9]{2})")


def _real(text: str) -> float | None:
    if not text:
        return None
    if not _NUMBER.fullmatch(text):
        raise ValueError(f"invalid number: {text!r}")
    return float(text)


def _whole(text: str) -> int | None:
    value = _real(text)
    return None if value is None else int(value)


def _scaled(text: str, unit: float) -> int | None:
    value = _real(text)
    return None if value is None else round(value * unit)


def _clock(text: str) -> Clock | None:
    if not text:
        return None
    found = _CLOCK.fullmatch(text)
    if not found:
        raise ValueError(f"invalid time of day: {text!r}")
    hour, minute, second, fraction = found.groups()
    return Clock(int(hour), int(minute), int(second), int((fraction or "").ljust(9, "0")))


def _date(text: str) -> tuple[int, int, int] | None:
    """Parse a date. Its year has two digits and is in this century. Raises ValueError for an invalid date."""
    if not text:
        return None
    found = _DATE.fullmatch(text)
    if not found:
        raise ValueError(f"invalid date: {text!r}")
    day, month, year = map(int, found.groups())
    return 2000 + year, month, day


def _angle(text: str, side: str, sides: str, most: int) -> int | None:
    """Parse degrees and minutes to 1e-7 degree, exactly. The second letter of `sides` gives a negative angle.

    Raises ValueError for an invalid angle.
    """
    if not text or not side:
        return None
    found = _ANGLE.fullmatch(text)
    if not found or side not in sides:
        raise ValueError(f"invalid angle: {text!r} {side!r}")
    degrees, minutes, fraction = found.groups()
    nano_minutes = int(minutes) * 10**9 + int((fraction or "").ljust(9, "0"))
    angle = int(degrees) * 10**7 + (nano_minutes + 3000) // 6000
    if angle > most * 10**7:
        raise ValueError(f"{text!r} is beyond {most} degrees")
    return -angle if side == sides[1] else angle
