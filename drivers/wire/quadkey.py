"""Quadkeys: tiles of the Web Mercator map, one digit a level, and the tiles around one.

A tile at depth d is one of 2**d columns, counted from the date line to the east, and 2**d rows, from the north. Its
quadkey has d digits, each a column's bit and twice a row's, the highest first. Source: Microsoft, "Bing Maps Tile
System"; the projection is EPSG:3857, on a sphere.
"""

import math
from typing import NamedTuple

from drivers.message import Position

MAX_DEPTH = 30  # tiles of 4 cm at the equator: deeper than a position of 1e-7 degree
MAX_LATITUDE = math.degrees(math.atan(math.sinh(math.pi)))  # 85.05 degree: what lies beyond is in the first or last row

_WORLD = 3_600_000_000  # 1e-7 degree
_KEEP = 0.1  # of a tile


class Tile(NamedTuple):
    """A tile. Columns are 0 to 2**depth - 1, and so are rows."""

    column: int
    row: int
    depth: int

    def digits(self) -> str:
        """The quadkey."""
        levels = range(self.depth - 1, -1, -1)
        return "".join(str((self.column >> at & 1) | (self.row >> at & 1) << 1) for at in levels)

    def around(self) -> frozenset["Tile"]:
        """The tile and its neighbours: nine, across the date line too; at the map's upper and lower edge six.

        At depth 1 they are all four tiles there are.
        """
        size = 1 << self.depth
        rows = range(max(0, self.row - 1), min(size, self.row + 2))
        return frozenset(Tile((self.column + step) % size, row, self.depth) for step in (-1, 0, 1) for row in rows)


def tile(position: Position, depth: int) -> Tile:
    """The tile of a position at 1 to MAX_DEPTH. Poles are in the first and last row, 180 degree in the last column."""
    column, row = _place(position, depth)
    last = (1 << depth) - 1
    return Tile(min(max(int(column), 0), last), min(max(math.floor(row), 0), last), depth)


def from_digits(digits: str) -> Tile:
    """The tile of a quadkey. Raises ValueError."""
    if not 1 <= len(digits) <= MAX_DEPTH or set(digits) - set("0123"):
        raise ValueError(f"{digits[:40]!r} is no quadkey: 1 to {MAX_DEPTH} digits 0, 1, 2 or 3")
    numbers = [int(digit) for digit in digits]
    column = sum((number & 1) << at for at, number in enumerate(reversed(numbers)))
    row = sum((number >> 1) << at for at, number in enumerate(reversed(numbers)))
    return Tile(column, row, len(digits))


def follow(position: Position, depth: int, last: Tile | None) -> Tile:
    """The tile of a position; the last one, as long as the position is within a tenth of a tile of it.

    A station that stands on an edge does not change its tile with the noise of its position.
    """
    if last is not None and last.depth == depth:
        column, row = _place(position, depth)
        size = 1 << depth
        aside = (column - last.column + size / 2) % size - size / 2
        if -_KEEP <= aside <= 1 + _KEEP and -_KEEP <= row - last.row <= 1 + _KEEP:
            return last
    return tile(position, depth)


def _place(position: Position, depth: int) -> tuple[float, float]:
    """Column and row of a position as fractions."""
    size = 1 << depth
    latitude = math.radians(min(max(position.latitude / 1e7, -MAX_LATITUDE), MAX_LATITUDE))
    row = (0.5 - math.asinh(math.tan(latitude)) / (2 * math.pi)) * size
    return (position.longitude + _WORLD // 2) * size / _WORLD, row
