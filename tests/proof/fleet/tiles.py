"""Tiles of a fleet: Web Mercator squares, each with the messages that are sent from it."""

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from tests.proof.fleet.region import LATITUDE

DEEPEST = 22
AROUND = tuple((east, south) for south in (-1, 0, 1) for east in (-1, 0, 1))  # the own tile among them
EQUATOR_M = 40_075_016.686  # WGS84

Tile = tuple[int, int]  # counted from 180 degrees west and 85.05 degrees north, at some depth


def tile(latitude: float, longitude: float) -> Tile:
    """The tile of a place at depth DEEPEST."""
    size = 1 << DEEPEST
    x = (longitude + 180) / 360 * size
    y = (1 - math.asinh(math.tan(math.radians(latitude))) / math.pi) / 2 * size
    return int(x), int(y)


def above(deepest: Tile, depth: int) -> Tile:
    """The tile of that depth that holds one of depth DEEPEST."""
    shift = DEEPEST - depth
    return deepest[0] >> shift, deepest[1] >> shift


def quadkey(found: Tile, depth: int) -> str:
    """Its digits, the largest tile first."""
    x, y = found
    return "".join(str((x >> at & 1) + 2 * (y >> at & 1)) for at in range(depth - 1, -1, -1))


def edge_m(depth: int) -> float:
    """Of a tile in the middle of the region."""
    return EQUATOR_M * math.cos(math.radians(LATITUDE)) / (1 << depth)


class Flow(NamedTuple):
    """Messages and octets of their PUBLISH packets, a second."""

    messages: float
    octets: float


class Grid:
    """What is sent from each tile of one depth.

    places  of the vehicles, at depth DEEPEST. flows: what each sends.
    """

    def __init__(self, depth: int, places: Sequence[Tile], flows: Sequence[Flow]) -> None:
        self.depth = depth
        messages: dict[Tile, float] = {}
        octets: dict[Tile, float] = {}
        shift = DEEPEST - depth
        for (x, y), flow in zip(places, flows, strict=True):
            key = x >> shift, y >> shift
            messages[key] = messages.get(key, 0.0) + flow[0]
            octets[key] = octets.get(key, 0.0) + flow[1]
        self.tiles = {key: Flow(sent, octets[key]) for key, sent in messages.items()}
        self._around: dict[Tile, Flow] = {}

    def around(self, place: Tile) -> Flow:
        """What is sent from the tile of a place and the eight around it."""
        key = above(place, self.depth)
        kept = self._around.get(key)
        if kept is None:
            near = [self.tiles[at] for at in neighbours(key) if at in self.tiles]
            kept = self._around[key] = Flow(sum(flow[0] for flow in near), sum(flow[1] for flow in near))
        return kept

    @property
    def busiest(self) -> Flow:
        """Of the tile that most is sent from."""
        return max(self.tiles.values())


def neighbours(key: Tile) -> Iterable[Tile]:
    """A tile and the eight around it."""
    x, y = key
    return [(x + east, y + south) for east, south in AROUND]


def crossings(speed: float, depth: int) -> float:
    """How often a second a vehicle enters another tile: over all headings the mean of |cos| + |sin| is 4 / pi."""
    return speed * 4 / (math.pi * edge_m(depth))
