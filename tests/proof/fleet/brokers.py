"""A fleet on several brokers, each with the tiles under one quadkey, and bridges between them.

A vehicle connects to the broker of the tile that it is in. What it hears from beyond the edge of that comes over a
bridge; bridges are configured by hand, so that they carry tiles of one depth, whatever a vehicle's own is.
"""

import heapq
from collections import defaultdict
from collections.abc import Callable, Hashable, Iterator, Sequence
from enum import Enum
from functools import cached_property
from typing import NamedTuple

from tests.proof.fleet.load import Load
from tests.proof.fleet.tiles import DEEPEST, Tile, above, neighbours

COARSEST, FINEST = 4, 20  # of a broker's tile: one of depth 4 holds the region
Shard = Hashable  # what names a broker
Members = dict[Shard, list[int]]  # numbers of its vehicles


class Bridges(Enum):
    """What goes from each broker to every other."""

    NONE = "none"
    EDGES = "edges"  # tiles that touch the other's
    ALL = "all"


class Broker(NamedTuple):
    """One of several: messages a second.

    taken    from its own vehicles. bridged_in, bridged_out: over all its bridges.
    delivered  to its own vehicles.
    """

    vehicles: int
    taken: float
    bridged_in: float
    bridged_out: float
    delivered: float

    @property
    def out(self) -> float:
        return self.delivered + self.bridged_out


class Cluster:
    """Brokers of a load.

    owner  which broker serves a place at depth DEEPEST.
    """

    def __init__(self, load: Load, owner: Callable[[Tile], Shard]) -> None:
        self.load = load
        self.members: Members = defaultdict(list)
        for number, place in enumerate(load.fleet.places):
            self.members[owner(place)].append(number)

    def brokers(self, bridges: Bridges, edge_depth: int) -> dict[Shard, Broker]:
        """What each has to do.

        edge_depth  of the tiles that bridges carry with EDGES: the coarsest that a vehicle subscribes to.
        """
        coming: dict[Shard, float] = defaultdict(float)
        going: dict[Shard, float] = defaultdict(float)
        for origin, target, messages in self._bridged(bridges, edge_depth):
            going[origin] += messages
            coming[target] += messages
        return {
            shard: Broker(len(each), self._taken[shard], coming[shard], going[shard], self._delivered[shard])
            for shard, each in self.members.items()
        }

    @cached_property
    def _taken(self) -> dict[Shard, float]:
        sent = self.load.sent
        return {shard: sum(sent[at].messages for at in each) for shard, each in self.members.items()}

    @cached_property
    def _delivered(self) -> dict[Shard, float]:
        received = self.load.received
        return {shard: sum(received[at].messages for at in each) for shard, each in self.members.items()}

    def unheard(self) -> float:
        """The share of what vehicles should hear that comes from beyond an edge: lost without bridges."""
        load = self.load
        parts = (load.part(each) for each in self.members.values())
        return 1 - sum(part.delivered.messages for part in parts) / load.delivered.messages

    def _bridged(self, bridges: Bridges, edge_depth: int) -> Iterator[tuple[Shard, Shard, float]]:
        """From, to, messages a second."""
        sent = self._taken
        if bridges is Bridges.ALL:
            yield from ((origin, target, sent[origin]) for origin in sent for target in sent if origin != target)
        elif bridges is Bridges.EDGES:
            yield from self._edges(edge_depth)

    def _edges(self, depth: int) -> Iterator[tuple[Shard, Shard, float]]:
        """Of each tile with vehicles that touches one of another broker's with vehicles."""
        owners: dict[Tile, dict[Shard, float]] = defaultdict(lambda: defaultdict(float))
        for shard, each in self.members.items():
            for at in each:
                owners[above(self.load.fleet.places[at], depth)][shard] += self.load.sent[at].messages
        for key, mine in list(owners.items()):
            targets = {shard for near in neighbours(key) for shard in owners.get(near, ())}
            for origin, messages in mine.items():
                yield from ((origin, target, messages) for target in targets if target != origin)


def balanced(load: Load, count: int) -> Cluster:
    """At least so many brokers: the quadkey with the most deliveries is divided into its four, again and again."""
    heard = [flow.messages for flow in load.received]
    leaves: list[tuple[float, int, Tile, list[int]]] = []

    def push(depth: int, numbers: Sequence[int]) -> None:
        inside: dict[Tile, list[int]] = defaultdict(list)
        for at in numbers:
            inside[above(load.fleet.places[at], depth)].append(at)
        for key, each in inside.items():
            heapq.heappush(leaves, (-sum(heard[at] for at in each), depth, key, each))

    push(COARSEST, range(load.fleet.size))
    while len(leaves) < count and leaves[0][1] < FINEST:
        _, depth, _, each = heapq.heappop(leaves)
        push(depth + 1, each)
    owners = {(depth, key): (depth, key) for _, depth, key, _ in leaves}
    depths = sorted({depth for _, depth, _, _ in leaves}, reverse=True)

    def owner(place: Tile) -> Shard:
        x, y = place
        found = (owners.get((depth, (x >> DEEPEST - depth, y >> DEEPEST - depth))) for depth in depths)
        return next(each for each in found if each is not None)

    return Cluster(load, owner)


def equal(load: Load, depth: int) -> Cluster:
    """A broker for each tile of a depth."""
    return Cluster(load, lambda place: above(place, depth))
