"""Benchmark of an MQTT interface: its cost for others, and its own speed.

First: latency from user to UDP at 1000/s, in each trouble, in alternating rounds. One station is without V2N, the
other sends every message by V2N as well. Then: 1000/s through mosquitto over TLS, both ways, at QoS 0 and 1, beside
plain paho loops. PAIRS (7) is the number of rounds, SCALE (1.0) the length of each; both are environment variables.
"""

import argparse
import json
import sys
from collections import Counter
from typing import Any

from tests.bench import figures, measure, programs, v2n_trouble
from tests.bench.figures import Line, Round
from tests.bench.start import begin
from tests.bench.subject import SOURCE, Station
from tests.bench.v2n_through import WAYS, through
from tests.bench.v2n_trouble import TROUBLES, Ground, Troubled, mute_names

RATE = 1000
COUNT = 3000  # of a round
WARM_UP = 300
MEDIAN_GOAL, P99_GOAL = 1.2, 2.0
RESULT = programs.ROOT / "build" / "bench-v2n.json"


def main() -> int:
    arguments = begin("tests.bench.v2n", __doc__, 7, SOURCE, _add)
    count = max(100, int(COUNT * arguments.scale))
    with v2n_trouble.ground() as ground:
        names = [name for name in TROUBLES if arguments.only in name and _is_possible(name, ground)]
        latencies = _latencies(ground, arguments.captain, names, arguments.pairs, count) if names else {}
        passed = _through(ground, arguments.captain, arguments.pairs, count) if len(names) != 1 else {}
    RESULT.write_text(json.dumps({"latencies": latencies, "through": passed}, indent=1))
    print(f"\nall figures: {RESULT.relative_to(programs.ROOT)}")
    return 0


def _add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--only", default="", help="troubles whose name holds this; `through` for none of them")


# ---------------------------------------------------------------- beside a trouble


def _is_possible(name: str, ground: Ground) -> bool:
    """A name server listens at port 53."""
    if TROUBLES[name] is not mute_names:
        return True
    try:
        with mute_names(ground):
            return True
    except PermissionError as error:
        print(f"bench: not measured: {name}: port 53: {error.strerror}; as root it is", file=sys.stderr)
        return False


def _latencies(
    ground: Ground, captain: str, names: list[str], pairs: int, count: int
) -> dict[str, dict[str, list[Round]]]:
    """Rounds by the name of the trouble; those without V2N lie between them, one more at the end of each round."""
    without: dict[str, list[Round]] = {name: [] for name in names}
    again: dict[str, list[Round]] = {name: [] for name in names}
    troubled: dict[str, list[Round]] = {name: [] for name in names}
    for number in range(pairs):
        print(f"pair {number + 1} of {pairs}", file=sys.stderr, flush=True)
        before = _round(Station(captain=captain), count)
        for name in names:
            with TROUBLES[name](ground) as trouble:
                troubled[name].append(_round(Troubled(captain, trouble), count))
            after = _round(Station(captain=captain), count)
            without[name].append(before)
            again[name].append(after)
            before = after
    print(f"user -> UDP at {RATE}/s, every message by V2N as well; medians of {pairs} pairs\n")
    print(figures.table(_lines(without, troubled, again), "without", "with V2N"))
    print(f"\n{_fates(troubled)}")
    return {"without": without, "with": troubled, "again": again}


def _round(subject: Station, count: int) -> Round:
    with subject:
        measure.latency(subject, "user-interface", RATE, WARM_UP)
        one = measure.latency(subject, "user-interface", RATE, count)
        status = subject.status()
    made: Round = {key: one["cam"][key] for key in ("median_us", "p99_us", "max_us")}
    made |= {"cpu_us": one["cpu_us"], "lost": one["sent"] - one["received"]}
    return made | _fate(status)


def _fate(status: dict[str, Any]) -> Round:
    """What became of the messages of V2N itself."""
    if (v2n := status["interfaces"].get("v2n")) is None:
        return {}
    drops = {row["reason"]: row["count"] for row in status["drops"] if row["where"] == "v2n"}
    return {"published": sum(v2n["sent"].values()), "from the broker": sum(v2n["received"].values()), "dropped": drops}


def _fates(troubled: dict[str, list[Round]]) -> str:
    """Of all rounds together: what V2N itself could do, and what the other interface lost."""
    rows = [f"{'of V2N itself':34}{'published':>10}{'received':>10}  dropped; lost by UDP"]
    for name, rounds in troubled.items():
        drops = sum((Counter(one["dropped"]) for one in rounds), Counter())
        said = ", ".join(f"{count} {reason}" for reason, count in sorted(drops.items())) or "none"
        published, received, lost = (
            sum(one[key] for one in rounds) for key in ("published", "from the broker", "lost")
        )
        rows.append(f"{name:34}{published:>10}{received:>10}  {said}; {lost}")
    return "\n".join(rows)


def _lines(
    without: dict[str, list[Round]], troubled: dict[str, list[Round]], again: dict[str, list[Round]]
) -> list[Line]:
    return [
        figures.compared(key, without[name], troubled[name], again[name], most=goal)._replace(what=f"{name}, {key}")
        for key, goal in (("median_us", MEDIAN_GOAL), ("p99_us", P99_GOAL), ("cpu_us", None))
        for name in without
    ]


# ---------------------------------------------------------------- through the broker


def _through(ground: Ground, captain: str, pairs: int, count: int) -> dict[str, Any]:
    plain: list[Round] = []
    station: list[Round] = []
    again: list[Round] = []
    for number in range(pairs):
        print(f"through the broker: pair {number + 1} of {pairs}", file=sys.stderr, flush=True)
        for rounds, kind in ((plain, ""), (station, captain), (again, "")):
            one: Round = {}
            for qos in (0, 1):
                for way in WAYS:
                    one |= through(ground, kind, way, qos, RATE, count)
            rounds.append(one)
    print(f"\n{RATE}/s through mosquitto over TLS beside plain paho loops; medians of {pairs} pairs\n")
    keys = [key for key in plain[0] if not key.endswith("lost")]
    print(figures.table([figures.compared(key, plain, station, again) for key in keys], "paho", "station"))
    lost = [sum(one[key] for one in rounds for key in one if key.endswith("lost")) for rounds in (plain, station)]
    print(f"lost: paho {lost[0]}, station {lost[1]}, of {pairs * 4 * count} each")
    return {"plain": plain, "station": station, "plain_again": again}


if __name__ == "__main__":
    sys.exit(main())
