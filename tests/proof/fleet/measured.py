"""The small end of the simulation, measured: two bridged mosquittos, vehicles that publish, copies of v2n-tap that listen.

Vehicles are those of the hot city around an edge between two brokers. They stay where they are: the simulation is of one
moment as well. How many there are follows from what one process can take (BUDGET), so that nothing but the brokers and
the profiles is measured.
"""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from tests.broker.mosquitto import Mosquitto
from tests.proof.fleet.brokers import Bridges, Broker, Cluster
from tests.proof.fleet.carried import Carried
from tests.proof.fleet.load import REPORTED_DEPTH, Fleet, Load
from tests.proof.fleet.tiles import DEEPEST, Tile, above, neighbours
from tests.proof.fleet.two_brokers import EAST, EDGE, EDGE_DEPTH, MIDDLE, WEST, Taps, counted, owner, two_brokers
from tests.proof.fleet.vehicles import Drive, Driven

BUDGET = 5000.0  # deliveries a second that one process with paho takes on a slow core
LONG = 600  # octets, and so many in each of them
MOST_VEHICLES = 300
SETTLE_S = 10.0  # at most, for what is on its way


class Compared(NamedTuple):
    """A rate, by the simulation and as it was seen."""

    what: str
    computed: float
    measured: float
    unit: str = "msg/s"

    @property
    def difference(self) -> float:
        """Relative; of nothing to nothing it is 0."""
        return (self.measured - self.computed) / self.computed if self.computed else float(self.measured != 0)


class Measured(NamedTuple):
    """What one profile has shown.

    published, heard   packets by all vehicles.
    expected   what should have been heard of what was published: nothing is lost where it is equal to heard.
    cpu_us     processor time of both brokers, by packet that they took or sent.
    tapped     messages by each copy of v2n-tap; of what was published, all of them.
    """

    profile: str
    vehicles: int
    rows: list[Compared]
    published: int
    expected: int
    heard: int
    cpu_us: float
    tapped: list[int]
    late_s: float


def chosen(fleet: Fleet, carried: Carried, budget: float) -> Load:
    """Vehicles around the edge, with a load below the budget: more of them and farther apart where there are tiles."""
    near = sorted(range(fleet.size), key=lambda at: _away(fleet, at))
    count, apart = MOST_VEHICLES, 4
    while _is_above(budget, load := Load(fleet.part(near[: count * apart : apart]), carried)):
        if load.has_tiles and 2 * count * apart < fleet.size:
            apart *= 2
        else:
            count = count * 9 // 10
    return load


def _is_above(budget: float, load: Load) -> bool:
    return load.delivered.messages > budget or load.delivered.octets > budget * LONG


def _away(fleet: Fleet, at: int) -> int:
    """From the edge, squared, in tiles of DEEPEST."""
    x, y = fleet.places[at]
    return (x - (EDGE << DEEPEST - EDGE_DEPTH)) ** 2 + (y - MIDDLE[1]) ** 2


def measure(
    fleet: Fleet,
    carried: Carried,
    duration_s: float,
    seed: int,
    keep: Path | None = None,
    budget: float = BUDGET,
    has_counts: bool = True,
) -> Measured:
    """Publish for duration_s at the computed rates, count everything until it is there, and compare.

    keep    a folder for copies of the brokers' configurations.
    budget  deliveries a second.
    has_counts  ask the brokers for theirs, for which some seconds are waited.
    """
    load = chosen(fleet, carried, budget)
    with two_brokers(carried, load) as both:
        if keep is not None:
            for name, broker in both.items():
                (keep / f"{carried.name}-{name}.conf").write_text(broker.file.read_text())
        taps = {name: Taps(carried, broker) for name, broker in both.items()}
        driven = [
            Driven(at, vehicle, load.fleet.rates[at], carried.profile, both[owner(load.fleet.places[at])].plain_port)
            for at, vehicle in enumerate(load.fleet.vehicles)
        ]
        drive = Drive(driven, seed)
        before = _counts(both) if has_counts else {}
        drive.publish_for(duration_s)
        expected = _expected(load, drive)
        drive.settle(lambda: sum(each.heard for each in driven) >= expected, SETTLE_S)
        after = _counts(both) if has_counts else {}
        tapped = {name: each.end() for name, each in taps.items()}
        drive.close()
    return _compared(load, drive, expected, before, after, tapped, duration_s)


Counted = tuple[dict[str, int], float]


def _counts(both: dict[str, Mosquitto]) -> dict[str, Counted]:
    return {name: (counted(broker), broker.cpu_s()) for name, broker in both.items()}


def _expected(load: Load, drive: Drive) -> int:
    """Packets that should be heard of what was really published, by the rules of the simulation: its rates replaced."""
    counts = Counter[int]()
    for (at, message), times in drive.sent.items():
        counts[at] += times * round(load.carried.heard[message].messages)
    if not load.has_tiles:
        return counts.total() * (load.fleet.size - 1)
    places, total = load.fleet.places, 0 if load.carried.has_echo else -counts.total()
    for depth in set(load.depths):
        inside: Counter[Tile] = Counter()
        for at, times in counts.items():
            inside[above(places[at], depth)] += times
        for at, own in enumerate(load.depths):
            if own == depth:
                total += sum(inside[near] for near in neighbours(above(places[at], depth)))
    return total


def _compared(
    load: Load,
    drive: Drive,
    expected: int,
    before: dict[str, Counted],
    after: dict[str, Counted],
    tapped: dict[str, list[list[dict[str, object]]]],
    duration_s: float,
) -> Measured:
    driven = drive.driven
    heard = sum(each.heard for each in driven)
    rows = [
        Compared("vehicle out, mean", load.total.messages / len(driven), _rate(drive, "published", duration_s)),
        Compared("vehicle in, mean", load.delivered.messages / len(driven), _rate(drive, "heard", duration_s)),
        _busiest_vehicle(load, drive, duration_s),
        Compared("vehicle out, mean", *_octets(load.total.octets, drive, "published_octets", duration_s), "kbit/s"),
        Compared("vehicle in, mean", *_octets(load.delivered.octets, drive, "heard_octets", duration_s), "kbit/s"),
        *_tiles(load, tapped, duration_s),
    ]
    cpu_us = 0.0
    if after:
        cpu_us = _count_brokers(rows, load, before, after, duration_s)
    published = sum(each.published for each in driven)
    sums = [len(copy) for name in (WEST, EAST) for copy in tapped[name]]
    return Measured(load.carried.name, len(driven), rows, published, expected, heard, cpu_us, sums, drive.late_s)


def _count_brokers(
    rows: list[Compared], load: Load, before: dict[str, Counted], after: dict[str, Counted], duration_s: float
) -> float:
    """Add the brokers' own counts. Returns microseconds of a processor by packet."""
    bridges = Bridges.EDGES if load.carried.tiles is not None else Bridges.ALL
    computed = Cluster(load, owner).brokers(bridges, EDGE_DEPTH)
    packets = 0
    for name in (WEST, EAST):
        took, sent = (after[name][0][way] - before[name][0][way] for way in ("received", "sent"))
        packets += took + sent
        rows += _broker_rows(name, load, computed[name], took / duration_s, sent / duration_s)
    return 1e6 * sum(after[name][1] - before[name][1] for name in (WEST, EAST)) / packets


def _broker_rows(name: str, load: Load, broker: Broker, took: float, sent: float) -> list[Compared]:
    """With what this set-up adds: the loop of inQueue to outQueue, and the copies of v2n-tap."""
    loop = broker.taken if load.carried.has_echo else 0.0
    tapped = broker.taken if load.carried.has_echo else broker.taken + broker.bridged_in
    return [
        Compared(f"broker {name} in", broker.taken + loop + broker.bridged_in, took),
        Compared(f"broker {name} out", broker.out + loop + tapped, sent),
    ]


def _rate(drive: Drive, name: str, duration_s: float) -> float:
    return sum(getattr(each, name) for each in drive.driven) / len(drive.driven) / duration_s


def _octets(computed: float, drive: Drive, name: str, duration_s: float) -> tuple[float, float]:
    """kbit/s of PUBLISH packets of one vehicle."""
    return computed * 8 / 1000 / len(drive.driven), _rate(drive, name, duration_s) * 8 / 1000


def _busiest_vehicle(load: Load, drive: Drive, duration_s: float) -> Compared:
    at = max(range(load.fleet.size), key=lambda number: load.received[number].messages)
    return Compared("vehicle in, busiest", load.received[at].messages, drive.driven[at].heard / duration_s)


def _tiles(load: Load, tapped: dict[str, list[list[dict[str, object]]]], duration_s: float) -> list[Compared]:
    """What the copies of v2n-tap took from each tile of REPORTED_DEPTH; without tiles in topics, by stationID."""
    inside: Counter[Tile] = Counter()
    for name, copies in tapped.items():
        for record in (record for copy in copies for record in copy):
            at = int(str(record["station_id"]))
            if owner(load.fleet.places[at]) == name:  # a message that came over a bridge is counted where it began
                inside[above(load.fleet.places[at], REPORTED_DEPTH)] += 1
    computed = load.tiles.tiles
    busiest = max(computed, key=lambda key: computed[key].messages)
    total = sum(flow.messages for flow in computed.values()) / len(computed)
    return [
        Compared("tile, busiest", computed[busiest].messages, inside[busiest] / duration_s),
        Compared("tile, mean", total, inside.total() / duration_s / len(computed)),
    ]


def worst(rows: Sequence[Compared]) -> float:
    """The largest relative difference."""
    return max(abs(row.difference) for row in rows)
