"""Two bridged mosquittos with an edge between them, and copies of v2n-tap that listen at each."""

import json
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

from tests.broker.certificates import Authority
from tests.broker.client import Client
from tests.broker.mosquitto import BRIDGE, Mosquitto
from tests.proof.fleet.carried import Carried
from tests.proof.fleet.load import Load
from tests.proof.fleet.region import LATITUDE, LONGITUDE
from tests.proof.fleet.tiles import DEEPEST, Tile, above, neighbours, quadkey, tile
from tests.proof.fleet.vehicles import PREFIX
from tests.system.ports import Ports

ROOT = Path(__file__).parents[3]
COPIES = 2  # of v2n-tap at each broker
EDGE_DEPTH = 15  # of tiles that bridges carry: the coarsest of profile orange
WEST, EAST = "west", "east"

# Where the edge is: the western border of the tile in the middle of the region.
MIDDLE = tile(LATITUDE, LONGITUDE)
EDGE = above(MIDDLE, EDGE_DEPTH)[0]

SYS_S = 1  # mosquitto counts its own messages once in that

# Every broker: bridges and back ends must not be the first to lose messages, and it counts for us.
MORE = f"""
sys_interval {SYS_S}
max_inflight_messages 1000
"""


def owner(place: Tile) -> str:
    return WEST if place[0] >> DEEPEST - EDGE_DEPTH < EDGE else EAST


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
            lines.append(_edge_line("/".join(quadkey(key, EDGE_DEPTH)), mine == WEST, carried.has_echo))
    return lines


def _edge_line(digits: str, is_out: bool, has_queues: bool) -> str:
    """With queues what one side puts into inQueue the other hears in outQueue."""
    if not has_queues:
        return f"{PREFIX}/{digits}/# {'out' if is_out else 'in'} 0"
    way, near_end, far_end = ("out", "in", "out") if is_out else ("in", "out", "in")
    return f"v2x/+/+/{digits}/# {way} 0 {PREFIX}/{near_end}Queue/ {PREFIX}/{far_end}Queue/"


def loop_topics(carried: Carried) -> list[str]:
    """Of a broker's bridge to itself: what vehicles put into inQueue they hear in outQueue."""
    return [f"v2x/# out 0 {PREFIX}/inQueue/ {PREFIX}/outQueue/"] if carried.has_echo else []


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
        options = ["--url", broker.plain_url, "--profile", carried.profile, "--prefix", PREFIX, "--published", "--json"]
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


def counted(broker: Mosquitto) -> dict[str, int]:
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
