"""Cost of the time path: receiver, pulses, estimate, chronyd; and for messages.

A station with a receiver and its pulses is measured against the same station without, in alternating rounds. Measured
are processor time while nothing is routed, and latency of messages at 1000/s both ways. All options have their
defaults. The receiver is simulated in a process of its own. Pulses come by the thread of pps/device.py from a
simulated kernel (time_station.py). A real chronyd, which touches no clock, is fed and asked. A station without,
measured again in each pair, shows the noise (A/A).

Not included: the interrupt, chronyd's own work, and that of chronyc, which is started every 10 s. The latter is
printed as a line of its own, in steps of 10 ms.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from typing import Any

from pps.chrony.configuration import refclock
from tests.bench import figures, measure, programs
from tests.bench.figures import Line, Round
from tests.bench.start import begin
from tests.bench.subject import SOURCE, Station
from tests.pps.chronyd import CHRONYC, Chronyd

RATE = 1000
COUNT = 3000  # messages each way, of a round
WARM_UP = 300
CPU_GOAL = 0.5  # % of a core
LATENCY_GOAL = 1.1  # of the medians: what is not told from noise
LOCKED_S = 40.0  # until then pulses tell the time: it takes 15 s
LOOK_S = 0.5
RESULT = programs.ROOT / "build" / "bench-time.json"

# The same simulated board, which looks at nothing but its own files, is under both.
BOARD = 'name = "bench"\nsimulated = true\n'
PULSE = '[pulse]\ndevice = "{device}"\n'
RECEIVER = """
[time]
chrony = "{chrony}"

[interfaces.gnss]
driver = "zed_f9p"
port = "{port}"
receiver_port = "uart1"
rate_hz = {rate_hz}
"""


class Timed(Station):
    """A station on a board of the bench."""

    def __init__(self, board: Path, more: str) -> None:
        super().__init__(more=more)
        self._board = board

    def command(self) -> Any:
        words = [word if word != "none" else str(self._board) for word in super().command()]
        return [sys.executable, "-m", "tests.bench.time_station", *words[1:]]

    def childrens_s(self) -> float:
        """Processor time of children that have ended: chronyc's."""
        after_name = Path(f"/proc/{self.process.pid}/stat").read_text().rpartition(")")[2].split()
        return sum(map(int, after_name[13:15])) / os.sysconf("SC_CLK_TCK")  # cutime and cstime of proc(5)

    def until_locked(self) -> None:
        end = time.monotonic() + LOCKED_S
        while (clock := self.status()["clock"])["state"] != "locked" or "stratum" not in clock["tracking"]:
            if time.monotonic() > end:
                raise RuntimeError(
                    f"the station's time is {clock['state']}, or chronyd says nothing: {json.dumps(clock, indent=1)}"
                )
            time.sleep(LOOK_S)


def main() -> int:
    arguments = begin("tests.bench.time_path", __doc__, 5, SOURCE, _add)
    if arguments.captain != SOURCE:
        print("bench: the kernel of a PPS device is played inside the program: it is measured from its source")
        return 2
    count = max(100, int(COUNT * arguments.scale))
    without: list[Round] = []
    again: list[Round] = []
    timed: list[Round] = []
    with tempfile.TemporaryDirectory() as folder:
        for number in range(arguments.pairs):
            print(f"pair {number + 1} of {arguments.pairs}", file=sys.stderr, flush=True)
            for rounds, has_time in ((without, False), (timed, True), (again, False)):
                rounds.append(_round(Path(folder), arguments, has_time, count))
    # What is missed is said in its row and by nothing else, as by the other benches: figures are for a reader.
    print(f"receiver at {arguments.rate_hz} Hz, pulses at 1 Hz; medians of {arguments.pairs} pairs\n")
    print(figures.table(_lines(without, timed, again), "without", "with time"))
    RESULT.write_text(json.dumps({"without": without, "with": timed, "again": again}, indent=1))
    print(f"\nall figures: {RESULT.relative_to(programs.ROOT)}")
    return 0


def _add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--duration", type=float, default=20.0, help="seconds of each round in which nothing is routed")
    parser.add_argument("--rate-hz", type=int, default=5, help="epochs of the receiver in a second")


def _round(folder: Path, arguments: argparse.Namespace, has_time: bool, count: int) -> Round:
    board = folder / "board.toml"
    device = folder / "pps0"
    device.touch()
    board.write_text(BOARD + (PULSE.format(device=device) if has_time else ""))
    if not has_time:
        with Timed(board, "") as station:
            time.sleep(LOOK_S)
            return _measured(station, arguments.duration, count)
    with _receiver() as port, _chronyd(folder) as chronyd:
        more = RECEIVER.format(port=port, chrony=chronyd, rate_hz=arguments.rate_hz)
        with Timed(board, more) as station:
            station.until_locked()
            return _measured(station, arguments.duration, count)


def _measured(station: Timed, duration: float, count: int) -> Round:
    before_s = station.childrens_s()
    made: Round = {"cpu_percent": measure.idle_percent(station, duration)}
    made["chronyc_percent"] = 100 * (station.childrens_s() - before_s) / duration
    for way in measure.WAYS:
        measure.latency(station, way, RATE, WARM_UP)
        one = measure.latency(station, way, RATE, count)
        made |= {f"{way} {key}": one["cam"][key] for key in ("median_us", "p99_us")}
    return made | {"memory_kb": station.memory_kb()}


def _lines(without: list[Round], timed: list[Round], again: list[Round]) -> list[Line]:
    keys = [(f"{way} {key}", LATENCY_GOAL if key == "median_us" else None)
            for way in measure.WAYS for key in ("median_us", "p99_us")]  # fmt: skip
    cpu = [b["cpu_percent"] - a["cpu_percent"] for a, b in zip(without, timed, strict=True)]
    noise = [b["cpu_percent"] - a["cpu_percent"] for a, b in zip(without, again, strict=True)]
    spent = Line(
        "time path, % of a core",
        0.0,
        median(cpu),
        floor_again=median(noise),
        goal=f"at most {CPU_GOAL:g}",
        is_reached=median(cpu) <= CPU_GOAL,
    )
    asked = Line("chronyc, % of a core", 0.0, median(one["chronyc_percent"] for one in timed))
    compared = [figures.compared(key, without, timed, again, most=goal) for key, goal in keys]
    return [spent, asked, *compared, figures.compared("memory_kb", without, timed, again)]


@contextmanager
def _receiver() -> Iterator[str]:
    """A simulated receiver; its port."""
    command = [sys.executable, "-m", "tests.bench.time_receiver"]
    pipe = subprocess.PIPE
    process = subprocess.Popen(command, cwd=programs.ROOT, stdin=pipe, stdout=pipe, text=True)
    try:
        assert process.stdout is not None
        yield process.stdout.readline().strip()
    finally:
        process.communicate()


@contextmanager
def _chronyd(folder: Path) -> Iterator[Path]:
    """A real chronyd with the line of the guide of time; yields its socket. chronyc is found by PATH, and asks this one."""
    home, programs_of = folder / "chronyd", folder / "bin"
    home.mkdir(exist_ok=True)
    programs_of.mkdir(exist_ok=True)
    path = os.environ["PATH"]
    with Chronyd(home, refclock(str(home / "pps.sock"))) as chronyd:
        chronyc = programs_of / "chronyc"
        chronyc.write_text(f'#!/bin/sh\nexec {CHRONYC} -h {chronyd.command} "$@"\n')
        chronyc.chmod(0o755)
        os.environ["PATH"] = f"{programs_of}:{path}"
        try:
            yield chronyd.socket
        finally:
            os.environ["PATH"] = path


if __name__ == "__main__":
    sys.exit(main())
