"""Quadkeys of Web Mercator map tiles, one digit per level, and the neighbours of a tile.

At depth d, the map has 2**d columns, counted eastward from the date line, and 2**d rows, counted from the north. The
quadkey has d digits, the most significant first. Each digit is a bit of the column plus twice a bit of the row.
Source: Microsoft, "Bing Maps Tile System"; the projection is EPSG:3857, on a sphere.
"""

import math
from typing import NamedTuple

from drivers.message import Position

MAX_DEPTH = 30  # tiles of 4 cm at the equator, close to the resolution of positions, 1e-7 degree
MAX_LATITUDE = math.degrees(math.atan(math.sinh(math.pi)))  # 85.05 degrees, edge of the map

_WORLD = 3_600_000_000  # 360 degrees in 1e-7 degree
_KEEP = 0.1  # share of a tile


class Tile(NamedTuple):
    """Map tile; column and row are 0 to 2**depth - 1."""

    column: int
    row: int
    depth: int

    def digits(self) -> str:
        """Return the quadkey of the tile."""
        levels = range(self.depth - 1, -1, -1)
        return "".join(str((self.column >> at & 1) | (self.row >> at & 1) << 1) for at in levels)

    def around(self) -> frozenset["Tile"]:
        """Return the tile and its neighbours: nine tiles, also across the date line.

        At the northern and southern edge of the map there are six. At depth 1, the result is the whole map, four tiles.
        """
        size = 1 << self.depth
        rows = range(max(0, self.row - 1), min(size, self.row + 2))
        return frozenset(Tile((self.column + step) % size, row, self.depth) for step in (-1, 0, 1) for row in rows)


def tile(position: Position, depth: int) -> Tile:
    """Return the tile of a position at a depth of 1 to MAX_DEPTH.

    The first and last row include the poles; the last column includes 180 degrees.
    """
    column, row = _tile_coordinates(position, depth)
    last = (1 << depth) - 1
    return Tile(min(max(int(column), 0), last), min(max(math.floor(row), 0), last), depth)


def from_digits(digits: str) -> Tile:
    """Return the tile of a quadkey. Raises ValueError if it has other than 1 to MAX_DEPTH digits 0, 1, 2, 3."""
    if not 1 <= len(digits) <= MAX_DEPTH or set(digits) - set("0123"):
        raise ValueError(f"invalid quadkey: {digits[:40]!r}; 1 to {MAX_DEPTH} digits 0, 1, 2 or 3")
    numbers = [int(digit) for digit in digits]
    column = sum((number & 1) << at for at, number in enumerate(reversed(numbers)))
    row = sum((number >> 1) << at for at, number in enumerate(reversed(numbers)))
    return Tile(column, row, len(digits))


def follow(position: Position, depth: int, last: Tile | None) -> Tile:
    """Return the tile of a position, with hysteresis.

    Returns the last tile while the position is inside it or within a tenth of a tile of its edge. So a station that is
    parked on an edge does not change its tile with the noise of its position.
    """
    if last is not None and last.depth == depth:
        column, row = _tile_coordinates(position, depth)
        size = 1 << depth
        aside = (column - last.column + size / 2) % size - size / 2
        if -_KEEP <= aside <= 1 + _KEEP and -_KEEP <= row - last.row <= 1 + _KEEP:
            return last
    return tile(position, depth)


def _tile_coordinates(position: Position, depth: int) -> tuple[float, float]:
    """Return column and row of a position as fractions."""
    size = 1 << depth
    latitude = math.radians(min(max(position.latitude / 1e7, -MAX_LATITUDE), MAX_LATITUDE))
    row = (0.5 - math.asinh(math.tan(latitude)) / (2 * math.pi)) * size
    return (position.longitude + _WORLD // 2) * size / _WORLD, row
