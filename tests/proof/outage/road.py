"""Position of the vehicle, and its subscriptions around it."""

import math
from collections.abc import Callable, Set

from drivers.message import Ego, Position
from drivers.wire.quadkey import Tile, follow, from_digits, tile
from tests.drivers.host import EGO
from tests.proof.chaos.run import Goal

# Metres per second, about a middle and within so many seconds: all three sizes of tiles are met, and it stands as well.
SPEED, MORE, PERIOD_S = 15.0, 15.0, 600.0
LATITUDE_M, LONGITUDE_M = 90.0, 137.0  # 1e-7 degree in a metre, at 49 degrees

# Of the profile: quadkey levels while it stands, and from which speeds on it is one and two less; not at once for the
# speed that is a little less.
DEPTH, SPEEDS, SLOWER = 17, (8.3, 22.0), 0.9

FOLLOW_S = 4.0  # own state is told once a second, tiles are looked at once a second, and two packets have to pass


def ego(now: float) -> Ego:
    """To the north-east, faster and slower."""
    turn = 2 * math.pi * now / PERIOD_S
    way = (SPEED * now - MORE * PERIOD_S / (2 * math.pi) * math.cos(turn)) / math.sqrt(2)
    there = Position(int(EGO.position.latitude + LATITUDE_M * way), int(EGO.position.longitude + LONGITUDE_M * way))
    return EGO._replace(position=there, speed=int(100 * (SPEED + MORE * math.sin(turn))))


class Followed:
    """Of one path: its subscriptions at the broker, beside where the vehicle is.

    filters     those at the broker.
    was_usable  as Account has it, of the path.
    """

    def __init__(self, filters: Set[str], was_usable: Callable[[float, float, float], bool]) -> None:
        self.moves = self.moves_in_trouble = self.looks = 0
        self.longest_s = 0.0
        self._filters = filters
        self._was_usable = was_usable
        self._centre: Tile | None = None
        self._wrong_since: float | None = None

    def look(self, own: Ego, is_troubled: bool, now: float) -> None:
        """Once a second or so."""
        self.looks += 1
        tiles = frozenset(_tile(one) for one in self._filters)
        self._count(own, tiles, is_troubled)
        if _is_around(own, tiles) or is_troubled or not self._was_usable(now - 1.0, now, 1.0):
            self._wrong_since = None
        elif self._wrong_since is None:
            self._wrong_since = now - 1.0
        else:
            self.longest_s = max(self.longest_s, now - self._wrong_since)

    def _count(self, own: Ego, tiles: Set[Tile], is_troubled: bool) -> None:
        """How often it has come into another tile of the size that it is subscribed to."""
        depth = max((one.depth for one in tiles), default=0)
        centre = tile(own.position, depth) if depth else None
        if centre and self._centre and centre != self._centre:
            self.moves += 1
            self.moves_in_trouble += is_troubled
        self._centre = centre

    def goal(self, name: str) -> Goal:
        seen = (
            f"{self.moves} tiles, {self.moves_in_trouble} of them amid trouble; it took {self.longest_s:.1f} s at most"
        )
        is_met = self.longest_s <= FOLLOW_S and self.moves_in_trouble > 0
        return Goal(f"{name}: it is subscribed to the nine tiles around it within {FOLLOW_S:g} s", seen, is_met)


def _is_around(own: Ego, tiles: frozenset[Tile]) -> bool:
    """Whether they are a tile of the size for the speed with its neighbours, and the vehicle is in the middle."""
    centre = next((one for one in tiles if one.around() == tiles), None)
    if centre is None:
        return False
    speed = own.speed / 100
    sizes = {DEPTH - sum(speed >= share * limit for limit in SPEEDS) for share in (1.0, SLOWER)}
    return centre.depth in sizes and follow(own.position, centre.depth, centre) == centre


def _tile(name: str) -> Tile:
    return from_digits("".join(level for level in name.split("/") if level in {"0", "1", "2", "3"}))
