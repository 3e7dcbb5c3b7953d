"""From the link to the indication: how long a station takes for a frame of a CAM.

usage: PYTHONPATH=TREE python reception.py BATCHES, with TREE's own Python

A station with one udp interface and a receiver's fix, as a box has it; frames are given to its GeoLink, and its router is
not asked. Names of modules are those of this tree or of an earlier one. Prints nanoseconds, the median.
"""

import importlib
import json
import sys
import tempfile
import time
from pathlib import Path
from statistics import median
from types import ModuleType
from typing import Any

REPEATS = 20
FRAMES = Path(__file__).parents[1] / "captures" / "frames.json"
SINGLE_HOP = ("cam-shb", "cam-shb-2")
# Of the source's position vector, TST: behind Ethernet, basic and common header and the address (EN 302 636-4-1, 9.5.2).
TIMESTAMP_AT = 14 + 4 + 8 + 8
ITS_EPOCH_MS, LEAP_MS = 1_072_915_200_000, 5_000


def main(batches: int) -> None:
    """Prints what was found."""
    loops = _module("board.runtime.loop", "board.loop")
    config = _module("firmware.config.captain_toml", "firmware.config")
    stations = _module("firmware.station.station", "firmware.station")
    links = _module("drivers.packet.geolink", "drivers.geolink")
    fixes = _module("board.time.scales", "board.time")
    source = getattr(config, "ConfigSource", None) or config.Source
    made = _made(links.GeoLink)
    with tempfile.TemporaryDirectory() as folder:
        sets = [f"endpoint.{name}=0" for name in ("from_users", "to_users", "pull", "report")]
        sets += [f"endpoint.control={folder}/control", "interfaces.air.driver=udp", "interfaces.air.listen=127.0.0.1:0"]
        loop = loops.Loop()
        station = stations.Station(loop, config.load(None, sets, "none"), source())
        station.start()
        loop.soon(loop.stop)
        loop.run()
        (link,) = made
        nanoseconds = _measured(link, fixes, loop.clock, batches)
        station.close()
    print(nanoseconds)


def _measured(link: Any, fixes: ModuleType, clock: Any, batches: int) -> float:
    """Median over batches of the time of one frame."""
    indications = []
    host = link._host
    if hasattr(host, "_indicate"):  # of earlier trees
        host._indicate = indications.append
    else:
        host._above.indicate = indications.append
    captured = [
        bytes.fromhex(one["hex"]) for one in json.loads(FRAMES.read_text())["frames"] if one["name"] in SINGLE_HOP
    ]
    taken = []
    for _ in range(batches):
        fix = fixes.Fix(clock(), fixes.FixKind.FULL, 487668616, 114320680, 450_000, 900, speed=100, heading=100)
        host.fix(fix._replace(utc_ns=time.time_ns()))
        timestamp = ((time.time_ns() // 1_000_000 - ITS_EPOCH_MS + LEAP_MS) % 2**32).to_bytes(4)
        frames = [one[:TIMESTAMP_AT] + timestamp + one[TIMESTAMP_AT + 4 :] for one in captured]
        indications.clear()
        began = time.perf_counter_ns()
        for _ in range(REPEATS):
            for frame in frames:
                link.receive(frame, 0)
        taken.append((time.perf_counter_ns() - began) / REPEATS / len(frames))
        if len(indications) != REPEATS * len(frames):
            raise SystemExit(f"{len(indications)} of {REPEATS * len(frames)} frames were indicated")
    return median(taken)


def _made(kind: Any) -> list[Any]:
    """Every object of a class that is made from now on."""
    made: list[Any] = []
    begin = kind.__init__

    def remember(self: Any, *arguments: Any, **options: Any) -> None:
        begin(self, *arguments, **options)
        made.append(self)

    kind.__init__ = remember
    return made


def _module(*names: str) -> ModuleType:
    """The first of them that the tree has."""
    for name in names:
        try:
            return importlib.import_module(name)
        except ModuleNotFoundError:
            continue
    raise SystemExit(f"no module {' or '.join(names)}")


if __name__ == "__main__":
    main(int(sys.argv[1]))
