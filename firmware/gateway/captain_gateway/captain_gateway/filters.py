"""Filters of received messages, by station, age and place."""

import math

from .codec import Edition
from .settings import Receive
from .values import Circle

EARTH_M = 6_371_008.8  # mean radius, IUGG
ITS_EPOCH_S = 1_072_915_200  # Unix time of 2004-01-01
DELTA = 65_536  # GenerationDeltaTime counts milliseconds modulo this
UNAVAILABLE = (900_000_001, 1_800_000_001)  # "unavailable" of LatitudeValue and LongitudeValue (TS 102 894-2)

Place = tuple[float, float]  # latitude, longitude in degrees


def refusal(pdu: bytes, edition: Edition, settings: Receive, own: Place | None) -> str | None:
    """Return why a message is not passed on: `station` or `area`; None if it is passed on.

    own  own position; None if unknown.

    A message without a position passes the area; every message does if the area needs own position and it is unknown.
    Raises ValueError if the message does not decode.
    """
    station = int.from_bytes(pdu[2:6], "big")
    if (settings.stations and station not in settings.stations) or station in settings.not_stations:
        return "station"
    if settings.area is not None and not is_inside(pdu, edition, settings.area, own):
        return "area"
    return None


def is_old(pdu: bytes, edition: Edition, clock: str, most_s: float, its_ms: int) -> bool:
    """Return whether a message is older than `most_s` seconds; False for a message without a time.

    clock   time format of the message, as in Kind.
    its_ms  current ITS time in milliseconds.
    """
    seconds = age(pdu, edition, clock, its_ms)
    return seconds is not None and seconds > most_s


def age(pdu: bytes, edition: Edition, clock: str, its_ms: int) -> float | None:
    """Return the seconds since the time in a message, negative for the future; None if it has no time.

    GenerationDeltaTime wraps every 65.536 s, so the result is then within -32.8 ... 32.8 s.
    clock, its_ms  as in is_old().
    """
    generated = None if edition.generated is None else edition.generated(pdu)[0]
    if generated is None:
        return None
    if clock == "its":
        return (its_ms - int(generated)) / 1000.0
    return ((its_ms - int(generated) + DELTA // 2) % DELTA - DELTA // 2) / 1000.0


def is_inside(pdu: bytes, edition: Edition, circle: Circle, own: Place | None) -> bool:
    centre = own if circle.latitude is None or circle.longitude is None else (circle.latitude, circle.longitude)
    found = None if edition.position is None else edition.position(pdu)
    if centre is None or found is None or None in found or found == UNAVAILABLE:
        return True
    return distance_m(centre, (found[0] / 1e7, found[1] / 1e7)) <= circle.radius_m


def distance_m(one: Place, other: Place) -> float:
    """Return the great-circle distance in m (haversine)."""
    (latitude, longitude), (to_latitude, to_longitude) = (map(math.radians, place) for place in (one, other))
    chord = (
        math.sin((to_latitude - latitude) / 2) ** 2
        + math.cos(latitude) * math.cos(to_latitude) * math.sin((to_longitude - longitude) / 2) ** 2
    )
    return 2 * EARTH_M * math.asin(min(1.0, math.sqrt(chord)))


def its_ms(unix_s: float, leap_seconds: int) -> int:
    """Return the ITS time in milliseconds for a Unix time.

    leap_seconds  inserted since 2004; 5 since 2017 (TS 102 894-2, TimestampIts).
    """
    return round((unix_s - ITS_EPOCH_S + leap_seconds) * 1000)
