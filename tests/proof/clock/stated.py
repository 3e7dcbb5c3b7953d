"""Stated quality of a station's time, beside the truth."""

import statistics

from tests.proof.clock.bench import Bench
from tests.proof.clock.machine import Guest, LateError
from tests.proof.clock.rows import Row
from tests.proof.clock.station import STALE_S, Report, Station


def statements(station: Station, since_s: float, until_s: float, when: str) -> Row:
    """Reports of a time whose interval holds the truth: 99.9 % of them is what they promise."""
    made = [report for report in station.reports if since_s <= report.at_s <= until_s and report.said["uncertainty_ns"]]
    known_ns = station.guest.ruler.host(0).half
    wrong = [report for report in made if not _holds(station, report, known_ns)]
    bounds_us = [report.said["uncertainty_ns"] / 1000 for report in made if report.said["state"] != "coarse"]
    median = f", median bound {statistics.median(bounds_us):.0f} us" if bounds_us else ""
    return Row.of(
        f"the truth is inside what the station states, {when}",
        f"{len(made) - len(wrong)} of {len(made)}{median}",
        "99.9 %",
        bool(made) and len(wrong) <= len(made) // 1000,
    )


def _holds(station: Station, report: Report, known_ns: int) -> bool:
    """Whether the truth was inside at any moment that it can be of: it has none of its own."""
    offset_ns, within_ns = report.said["offset_ns"], report.said["uncertainty_ns"] + known_ns
    found = [-station.error_ns(sample) for sample in station.between(report.at_s - STALE_S, report.at_s)]
    return bool(min(found) - within_ns <= offset_ns <= max(found) + within_ns)


def sound(station: Station) -> Row:
    """Whether the truth could be known."""
    is_sound = station.guest.ruler.is_sound
    return Row.of("the guest's oscillator is the host's clock", "yes" if is_sound else "no", "yes", is_sound)


def asked(on: Bench, guest: Guest, *words: str) -> str:
    """What a program in a guest says. Raises LateError where it cannot be run, or does not end."""
    said: list[str | None] = []
    guest.run(words, said.append)
    on.until(lambda: said, 60, " ".join(words))
    if said[0] is None:
        raise LateError(f"{' '.join(words)}: {guest.trouble[-1]}")
    return said[0]


def field(lines: str, name: str) -> str:
    """The line of chronyc that begins with a name."""
    return next((" ".join(line.split()) for line in lines.splitlines() if line.startswith(name)), f"no {name}")
