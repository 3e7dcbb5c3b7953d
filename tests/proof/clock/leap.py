"""Across 2016-12-31T23:59:60: announced by satellites, inserted by the kernel, and ITS time goes on."""

import time
from collections.abc import Iterator
from itertools import pairwise

from drivers.wire.gnss.time import Leap
from tests.proof.clock.machine import Kind
from tests.proof.clock.rows import Row
from tests.proof.clock.stated import asked, field, sound, statements
from tests.proof.clock.station import GPS_LEAD, Station
from tests.proof.clock.steered import FAST_PPB, OFF_NS, found, running
from tests.proof.clock.truth import EPOCH, LEAPS, S, Truth

LEAP_ITS_S = 1_483_228_800 - EPOCH + LEAPS - 1  # 2016-12-31T23:59:60Z
NEAR_S = 5.0


def measure(made: Kind) -> list[Row]:
    """A station from when its guest gets power, made.lead_s before it, to 30 s after it."""
    lead_s = made.lead_s
    truth = Truth(LEAP_ITS_S - lead_s, FAST_PPB, LEAP_ITS_S, LEAPS - 1)
    date = time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(truth.unix_ns(truth.its_s * S) // S))
    with running(made, truth, date, Leap(17, LEAP_ITS_S + GPS_LEAD, 1)) as (on, station):
        rows = list(found(on, station, on.loop.clock()))
        settled_s = on.loop.clock()
        on.until(lambda: on.loop.clock() > lead_s - 10, lead_s, "the last minute")
        tracking = asked(on, station.guest, "chronyc", "-n", "tracking")
        on.turn_for(10 + 30)
        said = field(tracking, "Leap status")
        rows.append(Row.of("chronyd says, 10 s before it", said, "Insert second", said.endswith("Insert second")))
        rows += _leapt(station, settled_s, lead_s)
        parts = {
            "before it": (settled_s, lead_s - NEAR_S),
            f"within {NEAR_S:.0f} s of it": (lead_s - NEAR_S, lead_s + NEAR_S),
            "after it": (lead_s + NEAR_S, on.loop.clock()),
        }
        rows += [statements(station, since_s, until_s, when) for when, (since_s, until_s) in parts.items()]
        rows.append(sound(station))
        return rows


def _leapt(station: Station, settled_s: float, lead_s: int) -> Iterator[Row]:
    near = [sample for sample in station.samples if sample.at_s >= settled_s]
    late = [sample for sample in near if abs(sample.at_s - lead_s) > 2]
    worst_us = max(abs(station.error_ns(sample)) / 1000 for sample in late)
    yield Row.of(
        "the system's clock, but for 2 s on either side of it",
        f"at most {worst_us:.0f} us wrong",
        "below 1 ms",
        worst_us < 1000,
    )
    wrong = [sample.at_s - lead_s for sample in near if abs(station.error_ns(sample)) > OFF_NS]
    seen = f"from {wrong[0]:+.2f} to {wrong[-1]:+.2f} s" if wrong else "never"
    yield Row.of(
        "wrong by a second, as the kernel carries it out",
        seen,
        "within 1 s of it",
        all(abs(at_s) < 1 for at_s in wrong),
    )
    reports = [report for report in station.reports if report.at_s >= settled_s and report.said["its_ms"]]
    off_ms = [round(1000 * (report.at_s + LEAP_ITS_S - lead_s) - report.said["its_ms"]) for report in reports]
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
