"""Across 2016-12-31T23:59:60: announced by satellites, inserted by the kernel, and ITS time goes on."""

from collections.abc import Iterator
from itertools import pairwise

from drivers.wire.gnss_time import Leap
from tests.clock.machine import Kind
from tests.clock.rows import Row
from tests.clock.stated import asked, field, sound, statements
from tests.clock.station import GPS_LEAD, Station
from tests.clock.steered import FAST_PPB, OFF_NS, found, running
from tests.clock.truth import EPOCH, LEAPS, Truth

LEAP_ITS_S = 1_483_228_800 - EPOCH + LEAPS - 1  # 2016-12-31T23:59:60Z
LEAD_S = 150  # before it, when its guest gets power: it is settled by then
NEAR_S = 5.0
DATE = "2016-12-31T23:57:30"


def measure(made: Kind) -> list[Row]:
    """A station from 150 s before it to 30 s after it."""
    truth = Truth(LEAP_ITS_S - LEAD_S, FAST_PPB, LEAP_ITS_S, LEAPS - 1)
    with running(made, truth, DATE, Leap(17, LEAP_ITS_S + GPS_LEAD, 1)) as (on, station):
        rows = list(found(on, station, on.loop.clock()))
        settled_s = on.loop.clock()
        on.until(lambda: on.loop.clock() > LEAD_S - 10, LEAD_S, "the last minute")
        tracking = asked(on, station.guest, "chronyc", "-n", "tracking")
        on.turn_for(10 + 30)
        said = field(tracking, "Leap status")
        rows.append(Row.of("chronyd says, 10 s before it", said, "Insert second", said.endswith("Insert second")))
        rows += _leapt(station, settled_s)
        parts = {
            "before it": (settled_s, LEAD_S - NEAR_S),
            f"within {NEAR_S:.0f} s of it": (LEAD_S - NEAR_S, LEAD_S + NEAR_S),
            "after it": (LEAD_S + NEAR_S, on.loop.clock()),
        }
        rows += [statements(station, since_s, until_s, when) for when, (since_s, until_s) in parts.items()]
        rows.append(sound(station))
        return rows


def _leapt(station: Station, settled_s: float) -> Iterator[Row]:
    near = [sample for sample in station.samples if sample.at_s >= settled_s]
    late = [sample for sample in near if abs(sample.at_s - LEAD_S) > 2]
    worst_us = max(abs(station.error_ns(sample)) / 1000 for sample in late)
    yield Row.of(
        "the system's clock, but for 2 s on either side of it",
        f"at most {worst_us:.0f} us wrong",
        "below 1 ms",
        worst_us < 1000,
    )
    wrong = [sample.at_s - LEAD_S for sample in near if abs(station.error_ns(sample)) > OFF_NS]
    seen = f"from {wrong[0]:+.2f} to {wrong[-1]:+.2f} s" if wrong else "never"
    yield Row.of(
        "wrong by a second, as the kernel carries it out",
        seen,
        "within 1 s of it",
        all(abs(at_s) < 1 for at_s in wrong),
    )
    reports = [report for report in station.reports if report.at_s >= settled_s and report.said["its_ms"]]
    off_ms = [round(1000 * (report.at_s + LEAP_ITS_S - LEAD_S) - report.said["its_ms"]) for report in reports]
    yield Row.of(
        f"ITS time as {len(off_ms)} reports say, when they come",
        f"{min(off_ms)} to {max(off_ms)} ms behind",
        "never another second",
        min(off_ms) >= -2 and max(off_ms) < 500,
    )
    stepped = [late - before for before, late in pairwise(off_ms)]
    yield Row.of(
        "between two of them it steps",
        f"by {max(map(abs, stepped))} ms at most",
        "by no second",
        max(map(abs, stepped)) < 500,
    )
