"""Short tasks of firmware/guide/ros2.md, run beside a gateway and a station.

.venv/bin/python -m tests.proof.ros2 --short --keep --only guide
"""

import json
import shutil
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

from asn1.backends.ros2.model import RosPackage
from tests.documents import blocks
from tests.firmware.gateway import real
from tests.proof.ros2 import codec, packages, ros, stations
from tests.proof.ros2.ros import RosError
from tests.proof.ros2.rows import Row
from tests.system.air import Air
from tests.system.conftest import Bench, Launcher

PAGE = (ros.ROOT / "firmware" / "guide" / "ros2.md").read_text()
PATIENCE_S = 30.0
PERIOD_S = 0.1  # period of send_cam.py
SOON_S = 0.02
SEVERAL = 20
STATION = 900003  # stationID in these CAMs
DENM_PORT = 2002


def run(made: list[RosPackage]) -> Iterator[Row]:
    """Run every task and compare what it prints or sends with the messages."""
    if not set(packages.SHORT) <= {edition for package in made for edition in package.tops}:
        yield Row("guide", f"left out: it needs {' and '.join(packages.SHORT)}")
        return
    library = codec.made(made)
    folder = Path(tempfile.mkdtemp(prefix="captain-guide-", dir=ros.MADE))
    for code in (*blocks(PAGE, "python ros2"), *blocks(PAGE, "python task")):
        (folder / code.splitlines()[0].removeprefix("# ")).write_text(code)
    launcher = Launcher(lambda: Path(tempfile.mkdtemp(dir=folder)))
    try:
        bench = launcher("btp")
        with stations.gateway(library, bench.station.ports, ros.MADE / "guide-gateway.log", ros.INSTALLED) as gateway:
            _wait(lambda: "gateway to " in gateway.said, lambda: None, gateway, "the gateway did not start")
            yield from _tasks(Tasks(bench, folder, library))
    finally:
        launcher.close()
        shutil.rmtree(folder)


class Tasks:
    """Programs of the guide in a folder, and the station that they use."""

    def __init__(self, bench: Bench, folder: Path, library: Path) -> None:
        self.air: Air = bench.air
        self.library = library
        self._folder = folder

    def start(self, name: str) -> stations.Node:
        command: list[str | Path] = [ros.ENV / "bin" / "python", self._folder / name]
        return stations.Node(command, stations.environment(self.library), ros.MADE / f"guide-{name}.log")

    def said(self, name: str, pdu: bytes, port: int, words: str) -> Row:
        """Send a PDU to the station until the program prints certain words."""
        with self.start(name) as node:
            _wait(lambda: words in node.said, lambda: self.air.send(pdu, port), node, f"no {words!r}")
        return Row(f"guide: {name}", words.strip())


def _tasks(tasks: Tasks) -> Iterator[Row]:
    cam = json.loads(stations.load(tasks.library).find("cam-1.4.1").to_json(real.CAM))
    station = cam["header"]["stationID"]
    parameters = cam["cam"]["camParameters"]
    place = parameters["basicContainer"]["referencePosition"]
    speed = parameters["highFrequencyContainer"]["basicVehicleContainerHighFrequency"]["speed"]["speedValue"]
    yield tasks.said("print_speed.py", real.CAM, 2001, f"{station} {speed / 100}\n")
    row = f",{station},{place['latitude'] / 1e7},{place['longitude'] / 1e7}\n"
    yield tasks.said("log_csv.py", real.CAM, 2001, row)
    denm = json.loads(stations.load(tasks.library).find("denm-1.3.1").to_json(real.DENM))
    cause = denm["denm"]["situation"]["eventType"]["causeCode"]
    yield tasks.said("warn.py", real.DENM, DENM_PORT, f"station {denm['header']['stationID']}: cause {cause}\n")
    yield _republished(tasks)
    yield _sent(tasks)


def _republished(tasks: Tasks) -> Row:
    with tasks.start("republish.py") as node:
        _wait(
            lambda: _heard(tasks.air) == real.DENM, lambda: tasks.air.send(real.DENM, DENM_PORT), node, "no DENM left"
        )
    return Row("guide: republish.py", f"{len(real.DENM)} octets, unchanged")


def _sent(tasks: Tasks) -> Row:
    """Measure the period of the CAMs that leave the station."""
    times: list[float] = []

    def is_enough() -> bool:
        if _heard(tasks.air)[2:6] == STATION.to_bytes(4):
            times.append(time.monotonic())
        return len(times) > SEVERAL

    with tasks.start("send_cam.py") as node:
        _wait(is_enough, lambda: None, node, "too few CAMs left")
    period_s = statistics.median(after - before for before, after in pairwise(times))
    is_right = abs(period_s - PERIOD_S) < PERIOD_S / 5
    return Row("guide: send_cam.py", f"a CAM each {period_s:.3f} s", "" if is_right else f"not {PERIOD_S} s")


def _heard(air: Air) -> bytes:
    """Return the next PDU from the station; empty if none comes soon."""
    air.socket.settimeout(SOON_S)
    try:
        return air.hear().pdu
    except TimeoutError:
        return b""


def _wait(holds: Callable[[], bool], again: Callable[[], None], node: stations.Node, words: str) -> None:
    """Call again() until holds() returns True. Raises RosError with the output of the node after PATIENCE_S."""
    ends = time.monotonic() + PATIENCE_S
    while not holds():
        if time.monotonic() > ends:
            raise RosError(f"{words}: {node.said[-2000:]}")
        again()
        time.sleep(SOON_S)
