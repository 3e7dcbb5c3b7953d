"""Cost of the recorder and the meter; behaviour with a failing disk.

A station with [recorder] is measured against the same station without, in alternating rounds of one run. All frames
of all interfaces go into a ring on a disk. In a third round `captain meter` listens as well. A station without
[recorder], measured again in each pair, shows the noise (A/A). On a machine of two cores the recorder takes time from
the generator too, which is the same for all.

Then a disk becomes full, and one is taken away: a tmpfs in a mount namespace of its own. Meanwhile messages at 1000/s
go through the station, and lost frames are counted.
"""

import argparse
import json
import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

from tests.bench import figures, measure, programs
from tests.bench.figures import Line, Round
from tests.bench.start import begin
from tests.bench.subject import SOURCE, Ports, Station, free_ports

RATE = 1000
COUNT = 3000  # messages each way, of a round
WARM_UP = 300
LATENCY_GOAL = 1.1
RATE_GOAL = 0.9
READY_S = 30.0  # the recorder is niced, and gives way to whatever else runs
LOOK_S = 0.05
IDLE_S = 5.0
DISK_OCTETS = 8 << 20
RESULT = programs.ROOT / "build" / "bench-record.json"
INSIDE = "CAPTAIN_BENCH_NAMESPACE"  # of the environment: mounts are nobody else's

RECORDER = """
[recorder]
folder = "{folder}"
size_mb = {size_mb}
in_memory = true
keep_on = []
"""


class Recorded(Station):
    """A station whose ports follow each other, as programs expect them; with a recorder where it has a folder."""

    def __init__(self, captain: str, folder: Path | None, size_mb: int = 64, framing: str = "pdu") -> None:
        more = RECORDER.format(folder=folder, size_mb=size_mb) if folder else ""
        super().__init__(framing, captain=captain, more=more)

    def find_ports(self) -> Ports:
        """Free ones, the four of the endpoint one after the other."""
        while True:
            ports = free_ports()
            row = range(ports.from_users, ports.from_users + 4)
            try:
                for port in row[1:]:
                    with socket.socket() as probe:
                        probe.bind(("127.0.0.1", port))
            except OSError:
                continue
            return ports._replace(to_users=row[1], pull=row[2], report=row[3])

    def until(self, holds: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        end = time.monotonic() + READY_S
        while True:
            with suppress(FileNotFoundError, ConnectionError):  # its ports listen a moment before its control socket
                if holds(status := self.status()):
                    return status
            if time.monotonic() > end:
                raise RuntimeError("it never came to hold: captain status tells more of the recorder")
            time.sleep(LOOK_S)  # a measurement's own process

    def recorder(self) -> dict[str, Any]:
        told: dict[str, Any] = self.status()["recorder"]
        return told


def main() -> int:
    if os.environ.get(INSIDE):
        return _in_trouble()
    arguments = begin("tests.bench.record", __doc__, 5, SOURCE, _add)
    rounds: dict[str, list[Round]] = {"without": [], "recorded": [], "metered": [], "again": []}
    with tempfile.TemporaryDirectory(dir=programs.BUILD) as folder:
        for number in range(arguments.pairs):
            print(f"pair {number + 1} of {arguments.pairs}", file=sys.stderr, flush=True)
            for name, made in rounds.items():
                made.append(_round(arguments, Path(folder) if name in ("recorded", "metered") else None, name))
    if arguments.pairs:
        print(f"medians of {arguments.pairs} pairs\n")
        print(figures.table(_lines(rounds["without"], rounds["recorded"], rounds["again"]), "without", "recorder"))
        print()
        print(figures.table(_lines(rounds["without"], rounds["metered"], rounds["again"]), "without", "+ meter"))
        print()
    RESULT.write_text(json.dumps(rounds, indent=1))
    status = _trouble(arguments.captain)
    print(f"\nall figures: {RESULT.relative_to(programs.ROOT)}")
    return status


def _add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--no-rate", action="store_true", help="leave the loss-free rate out: it takes most of the time"
    )


def _round(arguments: argparse.Namespace, folder: Path | None, name: str) -> Round:
    made: Round = {}
    with Recorded(arguments.captain, folder) as station, _meter(station, name == "metered"):
        if folder is not None:
            station.until(lambda status: bool(status["recorder"].get("file")))
        for way in measure.WAYS:
            measure.latency(station, way, RATE, WARM_UP)
        made["idle_percent"] = measure.idle_percent(station, IDLE_S * arguments.scale)
        for way in measure.WAYS:
            one = measure.latency(station, way, RATE, max(100, int(COUNT * arguments.scale)))
            made |= {f"{way} {key}": one["cam"][key] for key in ("median_us", "p99_us")}
            made[f"{way} cpu_us"] = one["cpu_us"]
            if not arguments.no_rate:
                made[f"{way} loss-free/s"] = measure.loss_free(station, way, measure.FINE)
        made["memory_kb"] = station.memory_kb()
        if folder is not None:
            time.sleep(1.5)  # it says once a second what it has written
            made["recorder"] = station.recorder()
    return made


@contextmanager
def _meter(station: Recorded, is_wanted: bool) -> Iterator[None]:
    if not is_wanted:
        yield
        return
    command = [SOURCE, "meter", "--at", f"A=127.0.0.1:{station.ports.from_users}", "--json"]
    meter = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    assert meter.stderr is not None
    try:
        if not (said := meter.stderr.readline()).startswith("captain: heard: "):
            raise RuntimeError(f"{' '.join(command)}: {said}")
        yield
    finally:
        meter.terminate()
        meter.communicate()


def _lines(without: list[Round], with_: list[Round], again: list[Round]) -> list[Line]:
    rows = []
    for way in measure.WAYS:
        rows.append(figures.compared(f"{way} median_us", without, with_, again, most=LATENCY_GOAL))
        rows.append(figures.compared(f"{way} p99_us", without, with_, again))
        rows.append(figures.compared(f"{way} cpu_us", without, with_, again))
        if f"{way} loss-free/s" in without[0]:
            rows.append(figures.compared(f"{way} loss-free/s", without, with_, again, least=RATE_GOAL))
    rows.append(figures.compared("memory_kb", without, with_, again))
    return rows


# -- a disk in trouble


class Step(NamedTuple):
    """Of the trouble: what was done, and what became of the messages that went through meanwhile."""

    what: str
    sent: int
    arrived: int
    median_us: float
    recorded: int
    lost: int
    trouble: str


def _trouble(captain: str) -> int:
    as_root = [] if os.geteuid() == 0 else ["--user", "--map-root-user"]
    inside = [sys.executable, "-m", "tests.bench.record"]
    command = ["unshare", *as_root, "--mount", "--propagation", "private", *inside]
    environment = {**os.environ, INSIDE: captain}
    return subprocess.run(command, env=environment, cwd=programs.ROOT, check=False).returncode


def _in_trouble() -> int:
    with tempfile.TemporaryDirectory() as place:
        disk = Path(place) / "disk"
        disk.mkdir()
        _mount(disk)
        try:
            steps = list(_steps(disk))
        finally:
            subprocess.run(["umount", "--lazy", str(disk)], check=True)
    print(_told(steps))
    is_well = all(one.arrived == one.sent and one.recorded + one.lost == one.sent for one in steps)
    lost = [one.lost for one in steps]
    return 0 if is_well and lost[1] and lost[3] and not (lost[0] or lost[2] or lost[4]) else 1


def _steps(disk: Path) -> Iterator[Step]:
    folder = disk / "ring"
    folder.mkdir()
    with Recorded(os.environ[INSIDE], folder, size_mb=1) as station:
        station.until(lambda status: bool(status["recorder"].get("file")))
        yield _step(station, "all is well")
        (disk / "others").write_bytes(bytes(_free(disk)))
        yield _step(station, "the disk is full")
        (disk / "others").unlink()
        _recovers(station)
        yield _step(station, "there is room again")
        subprocess.run(["umount", "--lazy", str(disk)], check=True)
        yield _step(station, "the card is taken out")
        _mount(disk)
        folder.mkdir()
        _recovers(station)
        yield _step(station, "another card is put in")


def _step(station: Recorded, what: str) -> Step:
    """Messages at RATE from the interface to a user, and the recorder's account of them when it has settled."""
    before = station.recorder()
    one = measure.flow(station, "interface-user", rate=RATE, count=COUNT, duration=2 * COUNT / RATE)
    sent = one["sent"]

    def is_settled(status: dict[str, Any]) -> bool:
        told = status["recorder"]
        return bool(sum(told[key] - before[key] for key in ("frames", "lost")) >= sent)

    after = station.until(is_settled)["recorder"]
    return Step(
        what,
        sent,
        one["received"],
        one["cam"]["median_us"],
        after["frames"] - before["frames"],
        after["lost"] - before["lost"],
        after["trouble"],
    )


def _recovers(station: Recorded) -> None:
    station.until(lambda status: not status["recorder"]["trouble"])


def _mount(disk: Path) -> None:
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={DISK_OCTETS}", "captain-bench", str(disk)], check=True)


def _free(disk: Path) -> int:
    found = os.statvfs(disk)
    return found.f_bavail * found.f_frsize


def _told(steps: list[Step]) -> str:
    head = f"{'a disk in trouble':26}{'sent':>8}{'arrived':>9}{'median us':>11}{'recorded':>10}{'lost':>8}  trouble"
    rows = []
    for one in steps:
        gone = f"; {-one.recorded} of them were in the file that went with it" if one.recorded < 0 else ""
        recorded = max(0, one.recorded)
        row = f"{one.what:26}{one.sent:>8}{one.arrived:>9}{one.median_us:>11.0f}{recorded:>10}{one.lost:>8}"
        rows.append(f"{row}  {one.trouble}{gone}")
    return "\n".join([head, *rows])


if __name__ == "__main__":
    sys.exit(main())
