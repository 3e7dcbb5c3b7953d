"""The streets that a swarm drives along: blocks of a town, or a user's own way."""

from math import ceil, cos, radians, sqrt
from pathlib import Path

from board.errors import RequestError
from drivers.sim.drive import LENGTH_M, STREET_M, WIDTH_M
from drivers.sim.track import METRES, Point, Track
from firmware.user.arguments import finite

EACH_BLOCK = 5  # vehicles around one block of 780 m
METRE_A_SECOND = 1.0  # of tracks that are asked for metres


def town(centre: Point, count: int) -> list[Track]:
    """A track around its block for each of so many vehicles; the blocks stand in a square around a place."""
    blocks = ceil(count / EACH_BLOCK)
    side = ceil(sqrt(blocks))
    tracks = [_around(centre, at // side - side // 2, at % side - side // 2) for at in range(blocks)]
    return [tracks[number // EACH_BLOCK] for number in range(count)]


def _around(centre: Point, row: int, column: int) -> Track:
    """In the middle of the streets around one block: as drivers/sim/drive.py, but for the place."""
    width, length = WIDTH_M + 2 * STREET_M, LENGTH_M + 2 * STREET_M
    north, east = row * length, column * width
    corners = ((north, east), (north, east + width), (north + length, east + width), (north + length, east))
    return Track(tuple(_place(centre, *corner) for corner in corners), METRE_A_SECOND)


def _place(centre: Point, north_m: float, east_m: float) -> Point:
    of_longitude = METRES * cos(radians(centre.latitude))
    return Point(centre.latitude + north_m / METRES, centre.longitude + east_m / of_longitude, centre.altitude_m)


def read(path: Path) -> Track:
    """A way from a file with a place a line, `LATITUDE,LONGITUDE[,ALTITUDE]`; round and round. Raises RequestError."""
    try:
        lines = path.read_text().splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise RequestError(f"{path}: {getattr(error, 'strerror', None) or 'it is no text'}") from error
    points = [_point(line, f"{path}: line {at}") for at, line in enumerate(lines, 1) if line.partition("#")[0].strip()]
    if not points:
        raise RequestError(f"{path}: it holds no place", "write a place a line: 48.7668,11.4320")
    return Track(tuple(points), METRE_A_SECOND)


def _point(line: str, where: str) -> Point:
    values = [finite(part) for part in line.partition("#")[0].split(",")]
    if not 2 <= len(values) <= 3 or None in values:
        raise RequestError(f"{where}: {line.strip()!r} is no place", "write it as 48.7668,11.4320")
    point = Point(*(value for value in values if value is not None))
    if not (-89 <= point.latitude <= 89 and -180 <= point.longitude <= 180 and -100 <= point.altitude_m <= 8000):
        raise RequestError(f"{where}: {line.strip()!r} is not on this earth's roads", "degrees, then metres")
    return point
