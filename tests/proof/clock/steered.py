"""A clock that is really steered: a whole station in a guest that begins 3.7 s and 40 ppm wrong."""

import statistics
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

from drivers.sim.receiver.habits import Habits
from drivers.sim.receiver.messages import Sky
from drivers.sim.receiver.receiver import Receiver
from drivers.wire.gnss.time import Leap
from tests.proof.clock.bench import Bench, Pulser, bench
from tests.proof.clock.machine import Kind
from tests.proof.clock.rows import Row
from tests.proof.clock.stated import asked, field, sound, statements
from tests.proof.clock.station import GPS_LEAD, Station
from tests.proof.clock.truth import EPOCH, LEAPS, S, Truth

FAST_PPB = 40_000
WRONG_NS = 3_700_000_000
ITS_S = 1_780_300_800 - EPOCH + LEAPS  # 2026-06-01T08:00:00Z
DATE = "2026-06-01T08:00:00"

START_S = 180.0  # the first time: the guest's Python compiles all sources; 15 s after that
SECOND_S = 60.0  # the goal
SETTLE_S = 300.0
CALM_S = 15.0  # below the goal for so long: it is settled
GOAL_NS = 1_000_000
OFF_NS = S // 2  # further off it is another second


@contextmanager
def running(made: Kind, truth: Truth, date: str, leap: Leap) -> Iterator[tuple[Bench, Station]]:
    """A station that is wrong by WRONG_NS and gets pulses, and whose programs have just been started."""
    with bench(truth) as on:
        receiver = Receiver(on.loop, Habits(gps_s=truth.its_s + GPS_LEAD, leap=leap))
        truth.start()
        station = Station(on, made, "steered", date, receiver)
        try:
            station.guest.hurry()  # a card boots for minutes beside other programs
            on.wait_for_guests()
            station.hold()
            on.pulser = Pulser(on.loop, truth, [station.guest.monitor], lambda struck: station.pulsed(struck[0]))
            station.wrong_by(WRONG_NS)
            station.start()
            station.watch()
            yield on, station
        finally:
            station.close()


def measure(made: Kind, calm_s: float, outage_s: float) -> list[Row]:
    """From the wrong time to the right one, so long at rest, without satellites for so long, and back."""
    truth = Truth(ITS_S, FAST_PPB)
    with running(made, truth, DATE, Leap(18)) as (on, station):
        began_s = on.loop.clock()
        rows = list(found(on, station, began_s))
        rows += _at_rest(on, station, calm_s)
        rows += _without(on, station, outage_s)
        rows += [statements(station, began_s, on.loop.clock(), "all the time"), sound(station)]
        return rows


# From the wrong time to the right one


def found(on: Bench, station: Station, began_s: float) -> Iterator[Row]:
    off_s = station.error_ns(station.samples[0]) / S
    yield Row.of(
        "the system's clock begins wrong",
        f"by {off_s:+.4f} s, {FAST_PPB / 1000:.0f} ppm",
        "by 3.7 s, 40 ppm",
        abs(off_s - WRONG_NS / S) < 0.01,
    )
    on.until(station.is_up, START_S, "the station's first report")
    up_s = on.loop.clock()
    on.until(lambda: abs(station.error_ns(station.samples[-1])) < OFF_NS, SETTLE_S, "the right second")
    took_s = on.loop.clock() - up_s
    yield Row.of(
        "the right second, after the station's first report",
        f"{took_s:.0f} s, {on.loop.clock() - began_s:.0f} s after it was started",
        f"{SECOND_S:.0f} s",
        took_s <= SECOND_S,
    )
    on.until(lambda: is_calm(station, on.loop.clock()), SETTLE_S, "an offset below 1 ms")
    yield Row(
        "settled, after the station's first report",
        f"{on.loop.clock() - up_s:.0f} s, {CALM_S:.0f} s of them below 1 ms",
        "none",
    )


def is_calm(station: Station, now_s: float) -> bool:
    """Whether its clock has been right to GOAL_NS for CALM_S."""
    errors = station.errors_ns(now_s - CALM_S)
    is_long = station.samples[0].at_s < now_s - CALM_S
    return is_long and all(abs(error) < GOAL_NS for error in errors)


def _at_rest(on: Bench, station: Station, calm_s: float) -> Iterator[Row]:
    began_s = on.loop.clock()
    on.turn_for(calm_s)
    errors_us = [error / 1000 for error in station.errors_ns(began_s)]
    worst_us = max(abs(error) for error in errors_us)
    known_us = station.guest.ruler.host(0).half / 1000
    yield Row.of(
        f"the system's clock against the host, {calm_s:.0f} s",
        f"median {statistics.median(errors_us):+.0f} us, at most {worst_us:.0f} us, to {known_us:.0f} us",
        "below 1 ms",
        worst_us * 1000 < GOAL_NS,
    )
    late_us = sorted(late / 1000 for late in station.late_ns)
    yield Row(
        "stamps of the pulses behind the host's moments",
        f"{late_us[0]:.0f}, {statistics.median(late_us):.0f}, {late_us[-1]:.0f} us: least, median, most of {len(late_us)}",
        "none: it is the emulator's",
    )
    said = station.reports[-1].said
    off_ppb = abs(said["frequency_ppb"] - FAST_PPB)
    yield Row.of(
        "frequency of the oscillator, as the station says",
        f"{said['frequency_ppb'] / 1000:+.2f} ppm, to {said['skew_ppb'] / 1000:.2f} ppm",
        f"{FAST_PPB / 1000:+.0f} ppm",
        off_ppb <= max(2 * said["skew_ppb"], 1000),
    )
    lines = asked(on, station.guest, "chronyc", "-n", "tracking")
    yield Row("chronyd says", "; ".join(field(lines, name) for name in ("Frequency", "Skew", "RMS offset")), "none")


# Without satellites


def _without(on: Bench, station: Station, outage_s: float) -> Iterator[Row]:
    assert on.pulser is not None
    began_s = on.loop.clock()
    station.receiver.sky = replace(station.receiver.sky, satellites=0)
    on.pulser.is_on = False
    on.turn_for(outage_s)
    state = station.reports[-1].said["state"]
    bound_us = station.reports[-1].said["uncertainty_ns"] / 1000
    error_us = station.error_ns(station.samples[-1]) / 1000
    yield Row.of(
        "without satellites the station says", f"{state}, within {bound_us:.0f} us", "holdover", state == "holdover"
    )
    yield Row("the system's clock at the end of it", f"{error_us:+.0f} us", "none")
    yield statements(station, began_s, on.loop.clock(), f"without satellites for {outage_s:.0f} s")
    station.receiver.sky = Sky()
    on.pulser.is_on = True
    back_s = on.loop.clock()
    on.until(lambda: station.reports[-1].said["state"] in ("locked", "settling"), 120, "pulses that are believed again")
    yield Row("believed again, after they are back", f"{on.loop.clock() - back_s:.0f} s", "none")
    on.turn_for(10)
