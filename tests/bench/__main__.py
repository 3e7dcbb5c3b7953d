"""`make bench`: the station beside a C forwarder of the same work, in alternating rounds of one run.

PAIRS (5) rounds of each; SCALE (1.0) of how long each round measures; both from the environment.
"""

import argparse
import json
import os
import sys
from pathlib import Path
from typing import Any

from tests.bench import figures, measure, overload, programs
from tests.bench.figures import Round
from tests.bench.start import begin
from tests.bench.subject import BINARY, SOURCE, Station, Subject

# messages per second: how many messages of one round
COUNTS = {10: 20, 100: 150, 1000: 2000}
WARM_UP = 300
IDLE_S = 3.0
RESULT = programs.ROOT / "build" / "bench.json"
FULL_PATH = {"prefix": measure.ethernet_prefix(300), "watched": True}


def main() -> int:
    arguments = begin("tests.bench", __doc__, 5, "", _add)
    floor, station, again, full = _pairs(arguments)
    rates = tuple(COUNTS)
    rows = figures.lines(floor, station, again, rates)
    print(figures.table(rows))
    print("\nfull path: framing ethernet, raw. and confirms read; station alone")
    print(figures.full_path(full, rates))
    flood = overload.report(arguments.captain, arguments.overload_s)
    result = {
        "pairs": {"floor": floor, "station": station, "floor_again": again, "full_path": full},
        "lines": [row._asdict() for row in rows],
        "overload": flood,
    }
    RESULT.write_text(json.dumps(result, indent=1))
    print(f"\nall figures: {RESULT.relative_to(programs.ROOT)}")
    return 0


def _add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--overload-s", type=float, default=float(os.environ.get("DURATION", "10")))


def _pairs(arguments: argparse.Namespace) -> tuple[list[Round], list[Round], list[Round], list[Round]]:
    captain = arguments.captain or SOURCE
    floor: list[Round] = []
    station: list[Round] = []
    again: list[Round] = []
    full: list[Round] = []
    for number in range(arguments.pairs):
        print(f"pair {number + 1} of {arguments.pairs}", file=sys.stderr, flush=True)
        floor.append(_round(Subject(), arguments.scale) | _start(Subject()))
        station.append(_round(Station(captain=captain), arguments.scale) | _starts(captain))
        again.append(_round(Subject(), arguments.scale))
        full.append(_round(Station("ethernet", captain), arguments.scale, **FULL_PATH))
    return floor, station, again, full


def _round(subject: Subject, scale: float, **how: Any) -> Round:
    """Everything that is measured of one running subject."""
    made: Round = {}
    with subject:
        for way in measure.WAYS:
            measure.latency(subject, way, 1000, WARM_UP, **how)
        made["idle_percent"] = measure.idle_percent(subject, IDLE_S * scale)
        made["memory_kb"] = subject.memory_kb()
        for way in measure.WAYS:
            for rate, count in COUNTS.items():
                one = measure.latency(subject, way, rate, max(10, int(count * scale)), **how)
                made |= {f"{way} {rate}/s {key}": one["cam"][key] for key in ("median_us", "p99_us", "max_us")}
                made |= {f"{way} {rate}/s {key}": one[key] for key in ("cpu_us", "cpu_percent")}
            made[f"{way} loss-free/s"] = measure.loss_free(subject, way, **how)
        made["memory_after_load_kb"] = subject.memory_kb()
    return made


def _start(subject: Subject) -> Round:
    return {"first_message_s": measure.first_message_s(subject)}


def _starts(captain: str) -> Round:
    made = _start(Station(captain=captain))
    if Path(BINARY).exists():
        made["first_message_binary_s"] = measure.first_message_s(Station(captain=BINARY))
        with Station(captain=BINARY) as frozen:
            measure.latency(frozen, "interface-user", 1000, WARM_UP)
            made["memory_binary_kb"] = frozen.memory_kb()
    return made


if __name__ == "__main__":
    sys.exit(main())
