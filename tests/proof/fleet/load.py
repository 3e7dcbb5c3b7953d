"""The load that a fleet makes by a profile: on its vehicles, on each tile, on one broker."""

from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import NamedTuple

from tests.proof.fleet.carried import Carried, total
from tests.proof.fleet.rates import Rates, rates
from tests.proof.fleet.region import Vehicle
from tests.proof.fleet.tiles import Flow, Grid, Tile, crossings, tile

REPORTED_DEPTH = 16  # of the tiles that the table speaks of where the profile has none
BUSY = 0.95  # the share of the vehicles that hears less than "busy" ones


class Fleet:
    """Vehicles with a station, and what they send, whatever profile carries it."""

    def __init__(self, vehicles: Sequence[Vehicle]) -> None:
        self.vehicles = vehicles
        self.rates: list[Rates] = [rates(vehicle, number) for number, vehicle in enumerate(vehicles)]
        self.places: list[Tile] = [tile(*vehicle.place) for vehicle in vehicles]

    def part(self, numbers: Iterable[int]) -> "Fleet":
        """Some of the vehicles, which send what they sent."""
        smaller = object.__new__(Fleet)
        chosen = list(numbers)
        smaller.vehicles = [self.vehicles[at] for at in chosen]
        smaller.rates = [self.rates[at] for at in chosen]
        smaller.places = [self.places[at] for at in chosen]
        return smaller

    @property
    def size(self) -> int:
        return len(self.vehicles)


class Spread(NamedTuple):
    """Of a value over all vehicles."""

    mean: float
    median: float
    busy: float  # 95 of 100 have less
    most: float


def spread(values: Sequence[float]) -> Spread:
    ordered = sorted(values)
    count = len(ordered)
    return Spread(sum(ordered) / count, ordered[count // 2], ordered[min(count - 1, int(BUSY * count))], ordered[-1])


class Load:
    """One fleet by one profile through one broker. Messages are packets: nap makes two or three of each.

    sent   by each vehicle.
    depth  of all tiles, in place of the profile's.
    """

    def __init__(self, fleet: Fleet, carried: Carried) -> None:
        self.fleet = fleet
        self.carried = carried
        self.sent = [total(carried.sent, each) for each in fleet.rates]
        self.depth: int | None = None
        self._audible = self.sent if carried.sent == carried.heard else [total(carried.heard, r) for r in fleet.rates]

    def with_depth(self, depth: int) -> "Load":
        """The same with other tiles."""
        return self._like(self.fleet, self.sent, self._audible, depth)

    def part(self, numbers: Sequence[int]) -> "Load":
        """Some of the vehicles, alone in the world."""
        sent, audible = ([flows[at] for at in numbers] for flows in (self.sent, self._audible))
        return self._like(self.fleet.part(numbers), sent, audible, self.depth)

    def _like(self, fleet: Fleet, sent: list[Flow], audible: list[Flow], depth: int | None) -> "Load":
        other = object.__new__(Load)
        other.fleet, other.carried = fleet, self.carried
        other.sent, other._audible, other.depth = sent, audible, depth
        return other

    @cached_property
    def depths(self) -> list[int]:
        """Of each vehicle's tiles."""
        if self.depth is not None:
            return [self.depth] * self.fleet.size
        return [self.carried.depth(vehicle.speed) for vehicle in self.fleet.vehicles]

    @property
    def has_tiles(self) -> bool:
        return self.depth is not None or self.carried.tiles is not None

    @cached_property
    def total(self) -> Flow:
        """What the broker takes in."""
        return _sum(self.sent)

    @cached_property
    def received(self) -> list[Flow]:
        """What each vehicle is sent."""
        if self.carried.has_echo:
            return self._around()
        pairs = zip(self._around(), self._audible, strict=True)
        return [Flow(heard[0] - own[0], heard[1] - own[1]) for heard, own in pairs]

    def _around(self) -> list[Flow]:
        if not self.has_tiles:
            return [_sum(self._audible)] * self.fleet.size
        grids = {depth: Grid(depth, self.fleet.places, self._audible) for depth in set(self.depths)}
        return [grids[depth].around(place) for depth, place in zip(self.depths, self.fleet.places, strict=True)]

    @cached_property
    def delivered(self) -> Flow:
        """What the broker sends out."""
        return _sum(self.received)

    @cached_property
    def heard(self) -> Spread:
        """Messages a second that vehicles are sent."""
        return spread([flow.messages for flow in self.received])

    @cached_property
    def downlink(self) -> Spread:
        """Bits a second to vehicles, at the IP layer."""
        bits = self.carried.ip_bits
        return spread([bits(heard, own.messages) for heard, own in zip(self.received, self.sent, strict=True)])

    @cached_property
    def uplink(self) -> Spread:
        """Bits a second from vehicles, acknowledgements of what they hear among them."""
        bits = self.carried.ip_bits
        return spread([bits(own, heard.messages) for heard, own in zip(self.received, self.sent, strict=True)])

    @cached_property
    def tiles(self) -> Grid:
        """What is sent from the tiles of REPORTED_DEPTH."""
        return Grid(REPORTED_DEPTH, self.fleet.places, self.sent)

    @cached_property
    def crossings_per_s(self) -> float:
        """How often vehicles enter another tile, and subscribe to its neighbours."""
        if not self.has_tiles:
            return 0.0
        pairs = zip(self.fleet.vehicles, self.depths, strict=True)
        return sum(crossings(vehicle.speed, depth) for vehicle, depth in pairs)


def _sum(flows: Sequence[Flow]) -> Flow:
    return Flow(sum(flow.messages for flow in flows), sum(flow.octets for flow in flows))
