"""Options of `captain meter`, and checks of their combinations."""

import argparse
import os
from pathlib import Path
from typing import NamedTuple

from board.runtime.errors import UsageError
from firmware.client import client
from firmware.client.arguments import HIGHEST_RATE, finite, integer, number, port, seconds, station, times
from firmware.meter import shows
from firmware.meter.matching import GRACE_S
from firmware.meter.meter import Ends
from firmware.meter.report import page

RATE_HZ = 10.0
# Limits of --interval. The longest is below 100, so that values meant as milliseconds (100, 1000) are rejected.
SHORTEST_S, LONGEST_S = 0.01, 60.0
# Options that only apply to a measurement with probes.
OF_PROBES = ("probe", "sender", "rate", "size", "count", "interface", "round_trip", "reflect")


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add all options; check() checks their combinations."""
    parser.add_argument("what", metavar="WHAT", nargs="*", help="two recordings, or table1 or table3")
    parser.add_argument(
        "--at",
        metavar="NAME=HOST[:PORT]",
        action="append",
        default=[],
        type=_named,
        help="station, under any name; the port that its users publish to, or all four separated by commas",
    )
    parser.add_argument("--duration", metavar="S", type=seconds, help="end after S seconds")
    parser.add_argument(
        "--interval",
        metavar="S",
        type=_interval,
        default=1.0,
        help="length T of the averaging intervals (default 1)",
    )
    parser.add_argument(
        "--grace",
        metavar="S",
        type=seconds,
        default=GRACE_S,
        help=f"messages later than S are late (default {GRACE_S:g})",
    )
    parser.add_argument(
        "--between",
        metavar="A:IF=B:IF",
        action="append",
        default=[],
        type=_ends,
        help="interfaces that hear each other, if neither name nor technology shows it",
    )
    probing = parser.add_argument_group("probes")
    probing.add_argument("--probe", metavar="TYPE", choices=("cam", "denm"), help="send probes: cam or denm")
    probing.add_argument("--from", metavar="NAME", dest="sender", help="station that sends them (default: the first)")
    probing.add_argument(
        "--rate",
        metavar="HZ",
        type=number("probes a second", HIGHEST_RATE),
        help=f"probes a second (default {RATE_HZ:g})",
    )
    probing.add_argument("--size", metavar="OCTETS", type=integer(1, 1500), help="minimum size of a probe")
    probing.add_argument("--count", metavar="N", type=times, help="end after N probes")
    probing.add_argument(
        "--interface", metavar="I", action="append", help="send by this interface only; may be repeated"
    )
    probing.add_argument("--round-trip", action="store_true", help="measure probes that the other end reflects")
    probing.add_argument("--reflect", action="store_true", help="send back each probe that this station receives")
    told = parser.add_argument_group("output")
    told.add_argument("--json", action="store_true", help="one JSON object in place of tables")
    told.add_argument("--report", metavar="FILE.html", type=Path, help="write a page, and .json and .geojson beside it")


def _interval(text: str) -> float:
    """Parse the interval in seconds.

    Raises ArgumentTypeError if it is out of range, also for a value meant as milliseconds.
    """
    value = finite(text)
    if value is None:
        raise argparse.ArgumentTypeError(f"{text!r}: not a number of seconds")
    if not SHORTEST_S <= value <= LONGEST_S:
        in_seconds = f"; for {text} ms write {value / 1000:g}" if value > LONGEST_S else ""
        raise argparse.ArgumentTypeError(f"{text}: out of range, {SHORTEST_S:g} to {LONGEST_S:g} seconds{in_seconds}")
    return value


class At(NamedTuple):
    """Station with its name in this measurement."""

    name: str
    place: client.Address


def _named(given: str) -> At:
    name, equals, where = given.partition("=")
    if not equals:
        name, where = "", given
    where, *others = where.split(",")
    host, first = station(where)
    if len(others) not in (0, 3):
        raise argparse.ArgumentTypeError(f"{given!r}: {len(others) + 1} ports; give the first one, or all four")
    to_users, pull, report = map(port, others) if others else (first + 1, first + 2, first + 3)
    return At(name or where, client.Address(host, first, to_users, pull, report))


def _ends(given: str) -> Ends:
    ends = [tuple(end.split(":")) for end in given.split("=")]
    if len(ends) != 2 or any(len(end) != 2 or not all(end) for end in ends):
        raise argparse.ArgumentTypeError(f"{given!r}: not two interfaces; for example A:g5=B:air")
    (one, by), (other, into) = ends
    return Ends((one, by), (other, into))


def check(arguments: argparse.Namespace) -> None:
    """Check the combination of options.

    Raises UsageError if options exclude each other, or the report cannot be written.
    """
    what, at = arguments.what, arguments.at
    _check_together(arguments)
    if what == ["table2"]:
        how = "run make ros2 ARGS='--only gateway' in the project's sources; it starts the meter, too"
        raise UsageError("table2: needs ROS 2, which this program does not contain", how)
    if what and what[0] in shows.SHOWS:
        if len(what) > 1 or at:
            raise UsageError(f"{what[0]}: not with other stations: it starts its own", f"captain meter {what[0]}")
    elif what:
        if len(what) != 2 or at:
            raise UsageError(f"recordings: {len(what)} in place of two", "captain meter A.pcapng B.pcapng")
    elif not at and not arguments.reflect:
        raise UsageError("--at: a station is missing", "captain meter --at A=HOST --at B=HOST")
    if len({one.name for one in at}) != len(at):
        raise UsageError("--at: two stations have the same name", "--at A=HOST --at B=HOST")
    if arguments.reflect and len(at) > 1:
        raise UsageError("--reflect: for one station only", "captain meter --reflect --at HOST")
    if arguments.sender is not None and arguments.sender not in [one.name for one in at]:
        raise UsageError(f"--from: {arguments.sender}: unknown station", "use a name of --at")
    if arguments.report is not None and arguments.report.suffix.lower() not in (".html", ".htm"):
        raise UsageError(f"--report: {arguments.report}: not the name of a page", "name it FILE.html")
    if arguments.report is not None and not os.access(arguments.report.parent, os.W_OK | os.X_OK):
        raise UsageError(f"--report: {arguments.report.parent}: you may not write there", "name a file elsewhere")
    if there := [path for path in page.paths(arguments.report) if path.exists()] if arguments.report else []:
        raise UsageError(f"--report: {there[0]}: the file exists", "name another file, or remove it")


def _check_together(arguments: argparse.Namespace) -> None:
    """Check that each given option has an effect. Raises UsageError for one without."""
    probing = set(OF_PROBES)
    if arguments.what and arguments.what[0] in shows.SHOWS:
        what, strange = arguments.what[0], probing | {"between"}
    elif arguments.what:
        what, strange = "a measurement of recordings", probing | {"duration"}
    elif arguments.reflect:
        what, strange = "--reflect", probing - {"reflect", "interface"} | {"between", "report"}
    elif not arguments.probe:
        what, strange = "a measurement without --probe", probing
    else:
        return
    given = [name for name in sorted(strange) if getattr(arguments, name) not in (None, False, [])]
    if given:
        option = "--from" if given[0] == "sender" else f"--{given[0].replace('_', '-')}"
        raise UsageError(f"{option}: without effect in {what}", "omit it")
