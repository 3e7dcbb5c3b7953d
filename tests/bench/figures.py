"""Figures of all pairs of measurements, each with its goal."""

from statistics import median
from typing import Any, NamedTuple

from tests.bench.measure import WAYS, ratio_of_medians

# One round of a subject: latencies by (way, rate), and single figures by name.
Round = dict[str, Any]


class Line(NamedTuple):
    """A row of the table; None is not measured or has no goal."""

    what: str
    floor: float | None
    station: float | None
    ratio: float | None = None
    floor_again: float | None = None
    goal: str = ""
    is_reached: bool | None = None


def lines(floor: list[Round], station: list[Round], again: list[Round], rates: tuple[int, ...]) -> list[Line]:
    """All rows: medians over the rounds, and medians of the ratios of each round to the floor's of the same pair."""
    made: list[Line] = []
    for way in WAYS:
        for rate in rates:
            for value in ("median_us", "p99_us"):
                key = f"{way} {rate}/s {value}"
                goal = 1.5 if (rate, value) == (1000, "median_us") else None
                made.append(compared(key, floor, station, again, most=goal))
    for way in WAYS:
        made.append(compared(f"{way} loss-free/s", floor, station, again, least=0.6))
    for way in WAYS:
        made.append(compared(f"{way} 1000/s cpu_us", floor, station, again))
        made.append(compared(f"{way} 1000/s cpu_percent", floor, station, again))
    made.append(_single("idle_percent", floor, station, 0.1, "% of a core"))
    made.append(_single("memory_kb", floor, station, 40_000, "kB"))
    made.append(_single("memory_after_load_kb", floor, station, 40_000, "kB"))
    made.append(_single("first_message_s", floor, station, 0.3, "s"))
    if all("first_message_binary_s" in one for one in station):
        made.append(_single("first_message_binary_s", floor, station, 0.6, "s"))
        made.append(_single("memory_binary_kb", floor, station, 40_000, "kB"))
    return made


def compared(
    key: str,
    floor: list[Round],
    station: list[Round],
    again: list[Round],
    most: float | None = None,
    least: float | None = None,
) -> Line:
    """A row of one figure: medians, the ratio within the pairs, the noise beside it, and its goal."""
    ratio = ratio_of_medians([(a[key], b[key]) for a, b in zip(floor, station, strict=True)])
    noise = ratio_of_medians([(a[key], b[key]) for a, b in zip(floor, again, strict=True)])
    goal, is_reached = "", None
    if most is not None:
        goal, is_reached = f"ratio <= {most}", ratio <= most
    elif least is not None:
        goal, is_reached = f"ratio >= {least}", ratio >= least
    return Line(key, _median(floor, key), _median(station, key), ratio, noise, goal, is_reached)


def table(rows: list[Line], first: str = "floor", second: str = "station") -> str:
    """The rows as text; A/A is the floor's second run to its first: how much of a ratio is noise."""
    head = f"{'':44}{first:>10}{second:>10}{'ratio':>8}{'A/A':>7}  goal"
    return "\n".join([head, *map(_row, rows)])


def full_path(rows: list[Round], rates: tuple[int, ...]) -> str:
    """The station alone with everything on: medians over its rounds."""
    keys = [f"{way} {rate}/s {value}" for way in WAYS for rate in rates for value in ("median_us", "p99_us")]
    keys += [f"{way} loss-free/s" for way in WAYS] + [f"{way} 1000/s cpu_us" for way in WAYS]
    return "\n".join(f"{key:54}{_number(_median(rows, key)):>10}" for key in keys)


def _single(key: str, floor: list[Round], station: list[Round], most: float, unit: str) -> Line:
    value = _median(station, key)
    mine = _median(floor, key) if all(key in one for one in floor) else None
    return Line(key, mine, value, goal=f"< {most:g} {unit}", is_reached=value < most)


def _median(rounds: list[Round], key: str) -> float:
    return float(median(one[key] for one in rounds))


def _row(line: Line) -> str:
    mark = {None: "", True: "reached", False: "MISSED"}[line.is_reached]
    return (
        f"{line.what:44}{_number(line.floor):>10}{_number(line.station):>10}{_number(line.ratio):>8}"
        f"{_number(line.floor_again):>7}  {line.goal}  {mark}".rstrip()
    )


def _number(value: float | None) -> str:
    if value is None:
        return ""
    return f"{value:.0f}" if value >= 100 else f"{value:.3g}"
