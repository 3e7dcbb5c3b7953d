"""Recordings of each kind of interface: tshark opens them; replays equal the original."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.broker.fixtures import Brokers
from tests.drivers.radio import library
from tests.system.conftest import Bench, Launcher
from tests.system.links import Broker, Datagrams, Link, Process, Radio, Serial, Whistle
from tests.system.recordings import (
    Recorded,
    addresses,
    are_the_same,
    endpoint_gives,
    indicated,
    recorded,
    replay,
    tshark_opens,
)
from tests.system.station import PATIENCE, ROOT, toml_table
from tests.system.v2n import ANY_PDU, table

FRAMINGS = {"eth": "ethernet", "btp": "btp", "bare": "pdu"}
OTHERS = ("radio", "v2n", "line", "whistle", "ipc")
KINDS = (*FRAMINGS, *OTHERS)
WITH_WAY_IN = (*FRAMINGS, "radio")  # kinds whose frames `captain replay` can send to the same kind of interface


class Scene(NamedTuple):
    """Station with an interface of each kind, and their far ends."""

    bench: Bench
    links: dict[str, Link]


Make = Callable[[], Scene]


@pytest.fixture(scope="module")
def make(launch_shared: Launcher, brokers_shared: Brokers, tmp_path_factory: pytest.TempPathFactory) -> Make:
    """Return a function that creates scenes in which all ends are connected, in both directions."""
    return lambda: _scene(launch_shared, brokers_shared, tmp_path_factory.mktemp("l"))


def _scene(launch: Launcher, brokers: Brokers, folder: Path) -> Scene:
    broker = brokers()
    observer = brokers.client(broker).subscribe(ANY_PDU, no_local=True)
    others: dict[str, Link] = {
        "radio": Radio(library(), launch.port(), launch.port()),
        "v2n": Broker(observer, table(brokers, broker.url)),
        "line": Serial(),
        "whistle": Whistle(folder),
        "ipc": Process(folder),
    }
    with pytest.MonkeyPatch.context() as patch:
        for link in others.values():
            launch.at_end(link.close)
            for name, value in link.environment.items():
                patch.setenv(name, value)
        bench = launch(
            interfaces=FRAMINGS,
            more="\n".join(toml_table(f"interfaces.{name}", link.table) for name, link in others.items() if link.table),
            endpoint=others["ipc"].endpoint,
            reception={"duplicate_window_s": 0.0},  # recordings of the same messages are replayed into it one by one
        )
    links = {name: Datagrams(air) for name, air in bench.airs.items()} | others
    for link in links.values():
        bench.user.join_receiving(link)
    bench.station.until(lambda status: all(one["state"] == "up" for one in status["interfaces"].values()))
    return Scene(bench, links)


@pytest.fixture(scope="module")
def first(make: Make, tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    scene = make()
    return recorded(scene.bench, scene.links, tmp_path_factory.mktemp("r"))


@pytest.fixture(scope="module")
def second(make: Make) -> Scene:
    return make()


@pytest.mark.parametrize("form", ["pcapng", "ring"])
def test_tshark_opens_what_each_kind_of_interface_brought(first: Recorded, form: str) -> None:
    tshark_opens(first.files[form], made_up=set(KINDS) - {"eth"})


@pytest.mark.parametrize("form", ["pcapng", "ring", "mcap"])
def test_as_frames_it_gives_the_users_of_another_station_the_same(first: Recorded, second: Scene, form: str) -> None:
    told = replay(str(first.files[form]), *second.links["eth"].way_in)
    assert told["read"] == told["sent"] == len(first.all)
    assert indicated(second.bench.user.receive() for _ in first.all) == indicated(first.all)


@pytest.mark.parametrize("name", WITH_WAY_IN)
def test_by_the_same_kind_of_interface_all_that_is_known_of_it_is_the_same(
    first: Recorded, second: Scene, name: str
) -> None:
    expected = first.received[name]
    replay(str(first.files["pcapng"]), "--interface", name, *second.links[name].way_in)
    are_the_same([second.bench.user.receive() for _ in expected], expected)


@pytest.mark.parametrize("form", ["pcapng", "ring", "mcap"])
def test_by_the_endpoint_it_leaves_by_each_kind_of_interface_as_it_came(
    first: Recorded, second: Scene, form: str
) -> None:
    told = replay(str(first.files[form]), *addresses(second.bench.station))
    assert told["outcomes"] == {"sent": len(first.all)}
    for link in second.links.values():
        endpoint_gives(link, first.all)


def test_frames_of_a_network_device_are_replayed_by_another(tmp_path: Path) -> None:
    command = ["unshare", "-Urn", sys.executable, "-m", "tests.system.recordings_of_a_device", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=4 * PATIENCE, check=False, cwd=ROOT)
    assert done.returncode == 0, done.stderr
