"""Tracks of a swarm: blocks of a simulated town, or a file of positions."""

from math import ceil, cos, radians, sqrt
from pathlib import Path

from board.runtime.errors import RequestError
from drivers.sim.drive import LENGTH_M, STREET_M, WIDTH_M
from drivers.sim.track import METRES, Point, Track
from firmware import file_remedy
from firmware.client.arguments import finite

PLACE = "write a place a line: LATITUDE,LONGITUDE, for example 48.7668,11.4320"
EACH_BLOCK = 5  # vehicles around one block, whose circumference is 780 m
METRE_A_SECOND = 1.0  # speed of a track, so that it can be asked for a distance in place of a time


def town(centre: Point, count: int) -> list[Track]:
    """Return a track around a block for each of `count` vehicles; the blocks form a square around the centre."""
    blocks = ceil(count / EACH_BLOCK)
    side = ceil(sqrt(blocks))
    tracks = [_around(centre, at // side - side // 2, at % side - side // 2) for at in range(blocks)]
    return [tracks[number // EACH_BLOCK] for number in range(count)]


def _around(centre: Point, row: int, column: int) -> Track:
    """Return a track along the middle of the streets around one block, as in drivers/sim/drive.py."""
    width, length = WIDTH_M + 2 * STREET_M, LENGTH_M + 2 * STREET_M
    north, east = row * length, column * width
    corners = ((north, east), (north, east + width), (north + length, east + width), (north + length, east))
    return Track(tuple(_offset(centre, *corner) for corner in corners), METRE_A_SECOND)


def _offset(centre: Point, north_m: float, east_m: float) -> Point:
    of_longitude = METRES * cos(radians(centre.latitude))
    return Point(centre.latitude + north_m / METRES, centre.longitude + east_m / of_longitude, centre.altitude_m)


def read(path: Path) -> Track:
    """Read a closed track from a file with one position per line: `LATITUDE,LONGITUDE[,ALTITUDE]`.

    The unit is degrees; altitudes are in metres.

    Raises RequestError for an unreadable file, a file without a position, and an invalid position.
    """
    try:
        lines = path.read_text().splitlines()
    except (OSError, UnicodeDecodeError) as error:
        if isinstance(error, UnicodeDecodeError):
            raise RequestError(f"--track: {path}: not a text file", PLACE) from error
        raise RequestError(f"--track: {path}: {error.strerror}", file_remedy.to_read(error)) from error
    points = [_point(line, f"{path}: line {at}") for at, line in enumerate(lines, 1) if line.partition("#")[0].strip()]
    if not points:
        raise RequestError(f"--track: {path}: no place in the file", PLACE)
    return Track(tuple(points), METRE_A_SECOND)


def _point(line: str, where: str) -> Point:
    values = [finite(part) for part in line.partition("#")[0].split(",")]
    if not 2 <= len(values) <= 3 or None in values:
        raise RequestError(f"{where}: invalid place: {line.strip()!r}", PLACE)
    point = Point(*(value for value in values if value is not None))
    if not (-89 <= point.latitude <= 89 and -180 <= point.longitude <= 180 and -100 <= point.altitude_m <= 8000):
        raise RequestError(
            f"{where}: out of range: {line.strip()!r}",
            "latitude -89 to 89, longitude -180 to 180, altitude -100 to 8000 m",
        )
    return point
