"""A swarm through one station, every message seen by `captain listen`; then more and more, until something breaks.

usage: python -m tests.proof.swarm [--duration 600] [--stations 200] [--rate 10] [--ceiling 10] [--only through|ceiling]

Ends with 1 when a message of the first run was lost, seen twice or dropped.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from firmware.client.show.table import Table, plain, width_of
from tests.bench.subject import SOURCE, Station

PATIENCE_S = 30.0
QUIET_S = 5.0  # what listen has not seen so long after it saw the last, it will not see
RATES = (20.0, 40.0, 60.0, 80.0, 120.0, 160.0)  # CAMs a second of each, past the ceiling
LATE_S = 0.1  # of the swarm: where more than a hundredth is later, it is what breaks


class Used(NamedTuple):
    """By a process: seconds of the processor, kB resident at most."""

    cpu_s: float
    memory_kb: int


class Run(NamedTuple):
    """One run. sent as the swarm says; taken, dropped, published as the station says; seen as listen says."""

    rate: float
    sent: int
    seconds: float
    late: int
    latest_s: float
    taken: int
    drops: dict[str, int]
    published: int
    is_slow: bool
    seen: int
    swarm: Used
    station: Used
    listen: Used
    differing: tuple[str, ...]  # stations whose CAMs listen counted differently

    @property
    def is_lossless(self) -> bool:
        return self.sent == self.taken == self.published == self.seen and not (self.drops or self.differing)

    @property
    def broken(self) -> str:
        """What did not keep up, from the sender on."""
        parts = []
        if self.late > self.sent / 100:
            parts.append(f"the swarm: {self.late} were late, up to {self.latest_s:.1f} s")
        if self.taken < self.sent:
            told = ", ".join(f"{count} {reason}" for reason, count in self.drops.items())
            parts.append(f"the station: {self.sent - self.taken} not taken ({told or 'not counted'})")
        if self.seen < self.published:
            slow = "; the station says that a user reads too slowly" if self.is_slow else ""
            parts.append(f"listen: {self.published - self.seen} that it did not see{slow}")
        return "; ".join(parts) or "nothing"


def main() -> int:
    options = arguments()
    status = 0
    if options.only != "ceiling":
        one = through(options.stations, options.rate, options.duration)
        show([one], f"{options.stations} stations at {options.rate:g} Hz for {options.duration:g} s")
        status = 0 if one.is_lossless else 1
        print("zero loss, every message seen" if one.is_lossless else f"NOT lossless: {one}")
    if options.only != "through" and options.ceiling:
        runs = []
        for rate in RATES:
            runs.append(through(options.stations, rate, options.ceiling))
            if not runs[-1].is_lossless:
                break
        show(runs, f"{options.stations} stations past the ceiling of a channel, {options.ceiling:g} s each")
    return status


def arguments() -> argparse.Namespace:
    assert __doc__ is not None
    parser = argparse.ArgumentParser(prog="python -m tests.proof.swarm", description=__doc__.splitlines()[0])
    parser.add_argument("--duration", type=float, default=600.0, help="of the first run, s")
    parser.add_argument("--stations", type=int, default=200)
    parser.add_argument("--rate", type=float, default=10.0, help="CAMs a second of each")
    parser.add_argument("--ceiling", type=float, default=10.0, help="of each run past the ceiling, s; 0: none")
    parser.add_argument("--only", choices=("through", "ceiling"))
    return parser.parse_args()


def through(stations: int, rate: float, duration: float) -> Run:
    """Swarm -> UDP frames -> station -> listen, each a process of its own."""
    with Station("ethernet") as station, listening(station) as listen:
        before = station.cpu_s()
        swarm = [SOURCE, "swarm", str(stations), "--rate", f"{rate:g}", "--duration", f"{duration:g}", "--json"]
        began = time.monotonic()
        sender = subprocess.Popen([*swarm, "--udp", f"127.0.0.1:{station.ports.listen}"], stdout=subprocess.PIPE)
        memories: dict[str, list[int]] = {"swarm": [0], "station": [0], "listen": [0]}
        while sender.poll() is None:
            processes = (("swarm", sender.pid), ("station", station.process.pid), ("listen", listen.process.pid))
            for name, pid in processes:
                memories[name].append(memory_kb(pid))
            time.sleep(1.0)
            assert time.monotonic() < began + 3 * duration + PATIENCE_S, "the swarm does not end"
        assert sender.stdout is not None
        told = json.loads(sender.stdout.read())
        sender.stdout.close()
        table = listen.end(told["sent"])
        status = station.status()
        bench = status["interfaces"]["bench"]
        used = {name: max(many) for name, many in memories.items()}
        return Run(
            rate,
            told["sent"],
            told["seconds"],
            told["late"],
            told["latest_s"],
            sum(bench["received"].values()),
            {row["reason"]: row["count"] for row in status["drops"]},
            status["endpoint"]["published"],
            status["endpoint"]["slow_since"] is not None,
            table.total,
            Used(told["cpu_s"], used["swarm"]),
            Used(station.cpu_s() - before, used["station"]),
            Used(table.cpu_s, used["listen"]),
            tuple(differing(told["stations"]["cam"], table.counts)),
        )


def differing(sent: dict[str, int], seen: Counter[str]) -> Iterator[str]:
    """Stations of which listen's table has another number; it has 256 rows at most."""
    if len(sent) <= 256:
        yield from (station for station, count in sent.items() if seen[station] != count)


class Seen(NamedTuple):
    """What listen has counted."""

    total: int
    counts: Counter[str]
    cpu_s: float


class Listener:
    """`captain listen`, its table in a file."""

    def __init__(self, station: Station, path: Path) -> None:
        self._path = path
        ports = station.ports
        addresses = ["--station", f"127.0.0.1:{ports.from_users}", "--report", str(ports.report)]
        with path.open("wb") as out:
            self.process = subprocess.Popen([SOURCE, "listen", *addresses], stdout=out)
        began = time.monotonic()
        while b" messages in " not in path.read_bytes():
            assert time.monotonic() < began + PATIENCE_S, "listen does not begin"
            time.sleep(0.05)

    def end(self, expected: int) -> Seen:
        """When all has come, or nothing comes any more: what its table says."""
        last, seen = time.monotonic(), -1
        while seen < expected and time.monotonic() < last + QUIET_S:
            time.sleep(0.2)
            if self._total() != seen:
                last, seen = time.monotonic(), self._total()
        time.sleep(2.0)  # another table is drawn, with every row that changed in its last second; and copies would come
        cpu_s = cpu(self.process.pid)
        self.process.terminate()
        self.process.wait(PATIENCE_S)
        return Seen(self._total(), self._rows(), cpu_s)

    def _total(self) -> int:
        """Number in the last title: `12:00:00  127.0.0.1:5558  4711 messages in 3 s`."""
        with self._path.open("rb") as stream:
            stream.seek(max(0, self._path.stat().st_size - (1 << 17)))
            titles = [line for line in stream.read().splitlines() if b" messages in " in line]
        words = titles[-1].split() if titles else []
        return int(words[words.index(b"messages") - 1]) if words else 0

    def _rows(self) -> Counter[str]:
        """The last count of each station: a table has those that were heard in its second."""
        found: Counter[str] = Counter()
        for line in self._path.read_text().splitlines():
            words = line.split()
            if words[:1] == ["cam"] and len(words) > 2:
                found[words[1]] = int(words[2])
        return found


@contextmanager
def listening(station: Station) -> Iterator[Listener]:
    with tempfile.TemporaryDirectory(prefix="swarm-") as folder:
        one = Listener(station, Path(folder) / "listen.txt")
        try:
            yield one
        finally:
            if one.process.poll() is None:
                one.process.kill()
                one.process.wait()


def memory_kb(pid: int) -> int:
    try:
        for line in Path(f"/proc/{pid}/status").read_text().splitlines():
            if line.startswith("VmRSS:"):
                return int(line.split()[1])
    except OSError:  # it has just ended
        pass
    return 0


def cpu(pid: int) -> float:
    """Seconds of user and system so far: proc(5), fields 14 and 15."""
    words = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")


HEADS = (
    ">a second", ">sent", ">taken", ">published", ">seen", ">late", ">latest s", ">swarm %", ">station %", ">listen %",
    ">swarm MB", ">station MB", ">listen MB", "what breaks",
)  # fmt: skip


def show(runs: list[Run], title: str) -> None:
    rows = [
        (
            f"{one.sent / one.seconds:.0f}",
            *(str(count) for count in (one.sent, one.taken, one.published, one.seen, one.late)),
            f"{one.latest_s:.2f}",
            *(f"{100 * used.cpu_s / one.seconds:.1f}" for used in (one.swarm, one.station, one.listen)),
            *(f"{used.memory_kb / 1000:.1f}" for used in (one.swarm, one.station, one.listen)),
            one.broken,
        )
        for one in runs
    ]
    print("\n".join(plain(Table(title, HEADS, rows), max(300, width_of(sys.stdout)))), flush=True)


if __name__ == "__main__":
    sys.exit(main())
