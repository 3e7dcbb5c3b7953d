"""Delay of a message between two guests, with clocks steered by pulses."""

import json
import statistics
from typing import NamedTuple

from board.time.scales import Lock, TimeQuality
from drivers.sim.receiver.habits import Habits
from drivers.sim.receiver.receiver import Receiver
from drivers.wire.gnss.time import Leap
from pps.delay import Delay, Stamp, one_way
from tests.proof.clock.bench import Bench, Pulser, Struck, bench
from tests.proof.clock.machine import Kind
from tests.proof.clock.rows import Row
from tests.proof.clock.station import GPS_LEAD, Report, Station
from tests.proof.clock.steered import DATE, FAST_PPB, ITS_S, SETTLE_S, START_S, is_calm
from tests.proof.clock.truth import Truth

WRONG_NS = {"a": 3_700_000_000, "b": -1_200_000_000}
AIR = """\
[interfaces.air]
driver = "ethernet"
device = "eth1"
"""


class Sent(NamedTuple):
    """A message that a user of a station has handed over, and when by its system's clock."""

    at_s: float
    digest: str
    sent_ns: int


class Passed(NamedTuple):
    """A message from one station to the other.

    delay    as the two stations' reports have it. true_ns: as the host has it.
    off_ns   by how much the receiving station's clock was wrong. error_ns: no more than this, as the message says.
    """

    delay: Delay
    true_ns: int
    off_ns: int
    error_ns: int


def measure(made: Kind, seconds: float) -> list[Row]:
    """Messages both ways for so long."""
    truth = Truth(ITS_S, FAST_PPB)
    with bench(truth) as on:
        habits = Habits(gps_s=truth.its_s + GPS_LEAD, leap=Leap(18))
        receivers = [Receiver(on.loop, habits) for _ in WRONG_NS]
        truth.start()
        names = zip(WRONG_NS, reversed(WRONG_NS), receivers, strict=True)
        stations = [_station(on, made, name, other, receiver) for name, other, receiver in names]
        try:
            on.wait_for_guests()

            def struck(pulses: list[Struck]) -> None:
                for station, pulse in zip(stations, pulses, strict=True):
                    station.pulsed(pulse)

            on.pulser = Pulser(on.loop, truth, [station.guest.monitor for station in stations], struck)
            sent = {station.name: _started(station) for station in stations}
            on.until(lambda: all(station.is_up() for station in stations), 2 * START_S, "both stations' first reports")
            for station in stations:
                station.guest.hurry()
            on.until(
                lambda: all(is_calm(station, on.loop.clock()) for station in stations), SETTLE_S, "two calm clocks"
            )
            for station in stations:
                station.guest.start("courier", "python3", "-m", "tests.proof.clock.guest.courier")
            on.until(lambda: all(station.heard for station in stations), START_S, "a message from each to the other")
            on.turn_for(seconds)
            a, b = stations
            there, back = _all_passed(a, b, sent["a"]), _all_passed(b, a, sent["b"])
            known_ns = a.guest.ruler.host(0).half + b.guest.ruler.host(0).half
            return [*_rows("there", there, known_ns), *_rows("back", back, known_ns), _reflection(there, back)]
        finally:
            for station in stations:
                station.close()


def _station(on: Bench, made: Kind, name: str, other: str, receiver: Receiver) -> Station:
    ends = ",".join(
        f"{end}.type=unix,{end}.path={on.folder}/{whose}.air" for end, whose in (("local", name), ("remote", other))
    )
    devices = [
        "-netdev",
        f"dgram,id=air,{ends}",
        "-device",
        f"virtio-net-pci,netdev=air,romfile=,mac=02:00:00:00:00:0{name}",
    ]
    return Station(on, made, name, DATE, receiver, AIR, devices)


def _started(station: Station) -> list[Sent]:
    sent: list[Sent] = []

    def line(text: str) -> None:
        if text.startswith("{"):
            said = json.loads(text)
            sent.append(Sent(station.now_s(), said["digest"], said["sent_ns"]))

    station.guest.told["courier"] = line
    station.wrong_by(WRONG_NS[station.name])
    station.start()
    station.watch()
    return sent


def _all_passed(one: Station, other: Station, sent: list[Sent]) -> list[Passed]:
    return [
        _passed(one, other, message, other.heard[message.digest]) for message in sent if message.digest in other.heard
    ]


def _rows(way: str, passed: list[Passed], known_ns: int) -> list[Row]:
    if not passed:
        return [Row(f"{way}: messages that arrived", "none", "some", "none arrived")]
    off_us = [(one.delay.ns - one.true_ns) / 1000 for one in passed]
    inside = [abs(one.delay.ns - one.true_ns) <= one.delay.uncertainty_ns + known_ns for one in passed]
    caused = [one.delay.ns + one.delay.uncertainty_ns > 0 for one in passed]
    stated = [abs(one.off_ns) <= one.error_ns + known_ns for one in passed]
    delays_us = [one.delay.ns / 1000 for one in passed]
    bounds_us = [one.delay.uncertainty_ns / 1000 for one in passed]
    return [
        Row.of(
            f"{way}: reported delays that contain the truth",
            f"{sum(inside)} of {len(inside)}, truth known to {known_ns / 1000:.0f} us",
            "99.9 %",
            len(inside) - sum(inside) <= len(inside) // 1000,
        ),
        Row(
            f"{way}: delay, from a user of one station to the kernel of the other",
            f"median {statistics.median(delays_us):.0f} us, least {min(delays_us):.0f}, +- {statistics.median(bounds_us):.0f} us",
            "none: it is the emulator's",
        ),
        Row(
            f"{way}: reported less true",
            f"median {statistics.median(off_us):+.0f} us, {min(off_us):+.0f} to {max(off_us):+.0f} us",
            "none",
        ),
        Row.of(
            f"{way}: times of reception that are no further off than the message says",
            f"{sum(stated)} of {len(stated)}, median bound {statistics.median(one.error_ns for one in passed) / 1000:.0f} us",
            "99.9 %",
            len(stated) - sum(stated) <= len(stated) // 1000,
        ),
        Row.of(f"{way}: none arrives before it was sent", f"{sum(caused)} of {len(caused)}", "all", all(caused)),
    ]


def _reflection(there: list[Passed], back: list[Passed]) -> Row:
    """In the sum of both ways what the two clocks are off by cancels: no truth is needed for it but one oscillator's."""
    reported = sum(statistics.median(one.delay.ns for one in way) for way in (there, back) if way)
    true = sum(statistics.median(one.true_ns for one in way) for way in (there, back) if way)
    off_us = (reported - true) / 1000
    return Row.of(
        "there and back: reported less true, of the medians", f"{off_us:+.0f} us", "to 100 us", abs(off_us) <= 100
    )


def _passed(one: Station, other: Station, message: Sent, heard: Report) -> Passed:
    sent = Stamp(message.sent_ns, _quality(one.report_at(message.at_s)))
    received = Stamp(heard.said["received_ns"], _quality(other.report_at(heard.at_s)))
    true_ns = (received.system_ns - other.off_ns(heard.at_s)) - (sent.system_ns - one.off_ns(message.at_s))
    off_ns, error_ns = other.off_ns(heard.at_s), heard.said["quality"]["error_ns"]
    return Passed(one_way(sent, received), true_ns, off_ns, error_ns or 0)


def _quality(report: Report) -> TimeQuality:
    said = report.said
    return TimeQuality(Lock[said["state"].upper()], said["offset_ns"], said["uncertainty_ns"])
