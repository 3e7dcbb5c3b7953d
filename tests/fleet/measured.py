"""The small end of the simulation, measured: two bridged mosquittos, vehicles that publish, copies of v2n-tap that listen.

Vehicles are those of the hot city around an edge between two brokers. They stay where they are: the simulation is of one
moment as well. How many there are follows from what one process can take (BUDGET), so that nothing but the brokers and
the profiles is measured.
"""

import json
import signal
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import NamedTuple

from tests.broker.certificates import Authority
from tests.broker.client import Client
from tests.broker.mosquitto import BRIDGE, Mosquitto
from tests.fleet.brokers import Bridges, Broker, Cluster
from tests.fleet.carried import Carried
from tests.fleet.load import REPORTED_DEPTH, Fleet, Load
from tests.fleet.region import LATITUDE, LONGITUDE
from tests.fleet.tiles import DEEPEST, Tile, above, neighbours, quadkey, tile
from tests.fleet.vehicles import PREFIX, Drive, Driven
from tests.system.ports import Ports

ROOT = Path(__file__).parents[2]
BUDGET = 5000.0  # deliveries a second that one process with paho takes on a slow core
MOST_VEHICLES = 300
EDGE_DEPTH = 15  # of tiles that bridges carry: the coarsest of profile orange
COPIES = 2  # of v2n-tap at each broker
SETTLE_S = 10.0  # at most, for what is on its way
SYS_S = 1  # mosquitto counts its own messages once in that

# Every broker: bridges and back ends must not be the first to lose messages, and it counts for us.
MORE = f"""
sys_interval {SYS_S}
max_inflight_messages 1000
"""
WEST, EAST = "west", "east"


class Compared(NamedTuple):
    """A rate, by the simulation and as it was seen. share: of its messages in all that was measured."""

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


# Where the edge is: the western border of the tile in the middle of the region.
MIDDLE = tile(LATITUDE, LONGITUDE)
EDGE = above(MIDDLE, EDGE_DEPTH)[0]


def owner(place: Tile) -> str:
    return WEST if place[0] >> DEEPEST - EDGE_DEPTH < EDGE else EAST


def chosen(fleet: Fleet, carried: Carried, budget: float) -> Load:
    """Vehicles around the edge, with a load below the budget: more of them and farther apart where there are tiles."""
    near = sorted(range(fleet.size), key=lambda at: _away(fleet, at))
    count, apart = MOST_VEHICLES, 4
    while (load := Load(fleet.part(near[: count * apart : apart]), carried)).delivered.messages > budget:
        if load.has_tiles and 2 * count * apart < fleet.size:
            apart *= 2
        else:
            count = count * 9 // 10
    return load


def _away(fleet: Fleet, at: int) -> int:
    """From the edge, squared, in tiles of DEEPEST."""
    x, y = fleet.places[at]
    return (x - (EDGE << DEEPEST - EDGE_DEPTH)) ** 2 + (y - MIDDLE[1]) ** 2


def bridge_topics(carried: Carried, load: Load) -> list[str]:
    """Lines of the bridge from west to east, as after `topic`: where a profile has tiles, those at the edge."""
    if carried.tiles is None:
        names = {"vcaptain": "v2x/btp/+ both 1", "raw": "v2x/+ both 1", "nap": "vanetza/# both 0"}
        return [names[carried.name]]
    by_owner: dict[Tile, set[str]] = {}
    for place in load.fleet.places:
        by_owner.setdefault(above(place, EDGE_DEPTH), set()).add(owner(place))
    lines = []
    for key, (mine, *_) in sorted((key, sorted(each)) for key, each in by_owner.items()):
        if any(by_owner.get(near, {mine}) != {mine} for near in neighbours(key)):
            pattern = f"v2x/+/+/{'/'.join(quadkey(key, EDGE_DEPTH))}/#"
            way, near_end, far_end = ("out", "in", "out") if mine == WEST else ("in", "out", "in")
            lines.append(f"{pattern} {way} 0 {PREFIX}/{near_end}Queue/ {PREFIX}/{far_end}Queue/")
    return lines


def loop_topics(carried: Carried) -> list[str]:
    """Of a broker's bridge to itself: what vehicles put into inQueue they hear in outQueue."""
    return [f"v2x/# out 0 {PREFIX}/inQueue/ {PREFIX}/outQueue/"] if carried.tiles is not None else []


@contextmanager
def two_brokers(carried: Carried, load: Load) -> Iterator[dict[str, Mosquitto]]:
    with tempfile.TemporaryDirectory() as folder, ExitStack() as closing:
        ports = Ports()
        closing.callback(ports.release)
        authority = Authority(Path(folder))
        both = {}
        for name in (EAST, WEST):
            place = Path(folder) / name
            place.mkdir()
            both[name] = Mosquitto(place, ports, authority, more=MORE)
        bridged = {WEST: [(both[EAST].plain_port, bridge_topics(carried, load))], EAST: []}
        for name, broker in both.items():
            for port, topics in [*bridged[name], (broker.plain_port, loop_topics(carried))]:
                if topics:
                    _add_bridge(broker, port, topics)
            closing.enter_context(broker)
        both[EAST].says(r"New client connected from .* as \S+bridge-to-\d+")
        if loop_topics(carried):
            for broker in both.values():
                broker.says(r"New client connected from .* as \S+loop-to-\d+")
        yield both


def _add_bridge(broker: Mosquitto, port: int, topics: Sequence[str]) -> None:
    """Its name is half of the client's at the far end: two bridges of one name would throw each other out there."""
    kind = "loop" if port == broker.plain_port else "bridge"
    text = BRIDGE.format(port=port).replace(f"connection to-{port}", f"connection {kind}-to-{port}")
    with broker.file.open("a") as file:
        file.write(text + "".join(f"topic {line}\n" for line in topics))


class Taps:
    """Copies of v2n-tap at one broker, which share what is published there."""

    def __init__(self, carried: Carried, broker: Mosquitto) -> None:
        options = ["--url", broker.plain_url, "--profile", carried.name, "--prefix", PREFIX, "--published", "--json"]
        self._files = [tempfile.TemporaryFile("w+") for _ in range(COPIES)]  # noqa: SIM115 until end()
        self._copies = [
            subprocess.Popen(
                [sys.executable, "-m", "firmware", "v2n-tap", *options],
                stdout=file,
                stderr=subprocess.PIPE,
                text=True,
                cwd=ROOT,
            )
            for file in self._files
        ]
        for copy in self._copies:
            assert copy.stderr is not None
            line = copy.stderr.readline()
            assert "subscribed" in line, line + copy.stderr.read()

    def end(self) -> list[list[dict[str, object]]]:
        """What each copy has taken."""
        for copy in self._copies:
            copy.send_signal(signal.SIGTERM)
        taken = []
        for copy, file in zip(self._copies, self._files, strict=True):
            _, said = copy.communicate(timeout=30)
            assert copy.returncode == 0, said
            file.seek(0)
            taken.append([json.loads(line) for line in file])
            file.close()
        return taken


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
            Driven(at, vehicle, load.fleet.rates[at], carried.name, both[owner(load.fleet.places[at])].plain_port)
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
    return {name: (_counted(broker), broker.cpu_s()) for name, broker in both.items()}


def _counted(broker: Mosquitto) -> dict[str, int]:
    """What mosquitto says that it received and sent: PUBLISH packets; with a few of its own to us.

    It publishes its counts one after the other: when two rounds have begun, the first is whole and of now.
    """
    names = ("received", "sent")
    with Client(broker.plain_port, "counting", host="127.0.0.1") as client:
        client.subscribe("$SYS/broker/uptime")
        rounds = 0
        while rounds < 2:
            rounds += not client.next("$SYS/broker/uptime").is_retained
        client.subscribe(*(f"$SYS/broker/publish/messages/{name}" for name in names))
        return {name: int(client.next(f"$SYS/broker/publish/messages/{name}").payload) for name in names}


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
    loop = broker.taken if load.carried.tiles is not None else 0.0
    tapped = broker.taken if load.carried.tiles is not None else broker.taken + broker.bridged_in
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
