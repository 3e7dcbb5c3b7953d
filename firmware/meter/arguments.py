"""Options of `captain meter`, and which of them go together."""

import argparse
import os
from pathlib import Path
from typing import NamedTuple

from board.errors import UsageError
from firmware.meter import page, shows
from firmware.meter.matching import GRACE_S
from firmware.meter.meter import Ends
from firmware.user import client
from firmware.user.arguments import HIGHEST_RATE, integer, number, port, seconds, station, times

RATE_HZ = 10.0
# By their names in the program: what is only of a measurement by probes.
OF_PROBES = ("probe", "sender", "rate", "size", "count", "interface", "round_trip", "reflect")


def add_options(parser: argparse.ArgumentParser) -> None:
    """All of them; check() says what goes together."""
    parser.add_argument("what", metavar="WHAT", nargs="*", help="two recordings, or table1 or table3")
    parser.add_argument(
        "--at",
        metavar="NAME=HOST[:PORT]",
        action="append",
        default=[],
        type=_named,
        help="a station, by any name; the port that its users publish to, or all four with commas between",
    )
    parser.add_argument("--duration", metavar="S", type=seconds, help="end after so many seconds")
    parser.add_argument(
        "--interval", metavar="MS", type=integer(10, 3_600_000), default=1000, help="T, averaged over (default 1000)"
    )
    parser.add_argument(
        "--grace", metavar="S", type=seconds, default=GRACE_S, help=f"what is later is late (default {GRACE_S:g})"
    )
    parser.add_argument(
        "--between",
        metavar="A:IF=B:IF",
        action="append",
        default=[],
        type=_ends,
        help="interfaces that hear each other, where neither name nor technology says so",
    )
    probing = parser.add_argument_group("probes")
    probing.add_argument("--probe", metavar="TYPE", choices=("cam", "denm"), help="send probes: cam or denm")
    probing.add_argument(
        "--from", metavar="NAME", dest="sender", help="the station that sends them (default the first)"
    )
    probing.add_argument(
        "--rate", metavar="HZ", type=number("probes a second", HIGHEST_RATE), help=f"default {RATE_HZ:g}"
    )
    probing.add_argument("--size", metavar="OCTETS", type=integer(1, 1500), help="at least so many each")
    probing.add_argument("--count", metavar="N", type=times, help="end after so many")
    probing.add_argument("--interface", metavar="I", action="append", help="only by this interface; may be repeated")
    probing.add_argument("--round-trip", action="store_true", help="somebody reflects them")
    probing.add_argument("--reflect", action="store_true", help="send back what probes this station receives")
    told = parser.add_argument_group("what is told")
    told.add_argument("--json", action="store_true", help="one JSON object in place of tables")
    told.add_argument("--report", metavar="FILE.html", type=Path, help="a page, and .json and .geojson beside it")


class At(NamedTuple):
    """A station by the name that it is to have here."""

    name: str
    place: client.Address


def _named(given: str) -> At:
    name, equals, where = given.partition("=")
    if not equals:
        name, where = "", given
    where, *others = where.split(",")
    host, first = station(where)
    if len(others) not in (0, 3):
        raise argparse.ArgumentTypeError(f"{given!r}: a station has one port and three after it, or four by name")
    to_users, pull, report = map(port, others) if others else (first + 1, first + 2, first + 3)
    return At(name or where, client.Address(host, first, to_users, pull, report))


def _ends(given: str) -> Ends:
    ends = [tuple(end.split(":")) for end in given.split("=")]
    if len(ends) != 2 or any(len(end) != 2 or not all(end) for end in ends):
        raise argparse.ArgumentTypeError(f"{given!r} names no two interfaces: A:g5=B:air")
    (one, by), (other, into) = ends
    return Ends((one, by), (other, into))


def check(arguments: argparse.Namespace) -> None:
    """Raise UsageError where options do not go together, or a page cannot be written."""
    what, at = arguments.what, arguments.at
    _check_together(arguments)
    if what == ["table2"]:
        how = "make ros2 ARGS='--only gateway', in the project's sources, builds that and has the meter beside it"
        raise UsageError("table2 goes through two ROS 2 gateways, and ROS 2 is no part of this program", how)
    if what and what[0] in shows.SHOWS:
        if len(what) > 1 or at:
            raise UsageError(f"{what[0]} starts its own stations", f"captain meter {what[0]}")
    elif what:
        if len(what) != 2 or at:
            raise UsageError("recordings are measured two at a time", "captain meter A.pcapng B.pcapng")
    elif not at and not arguments.reflect:
        raise UsageError("no station is named", "captain meter --at A=HOST --at B=HOST")
    if len({one.name for one in at}) != len(at):
        raise UsageError("--at: two stations have one name", "--at A=HOST --at B=HOST")
    if arguments.reflect and len(at) > 1:
        raise UsageError("--reflect is for one station", "captain meter --reflect --at HOST")
    if arguments.sender is not None and arguments.sender not in [one.name for one in at]:
        raise UsageError(f"--from {arguments.sender}: no --at has that name")
    if arguments.report is not None and arguments.report.suffix.lower() not in (".html", ".htm"):
        raise UsageError(f"--report: {arguments.report} is no name of a page", "name it FILE.html")
    if arguments.report is not None and not os.access(arguments.report.parent, os.W_OK | os.X_OK):
        raise UsageError(f"--report: nothing can be written into {arguments.report.parent}", "name a folder of yours")
    if there := [path for path in page.paths(arguments.report) if path.exists()] if arguments.report else []:
        raise UsageError(f"--report: {there[0]} is there already", "name another, or remove it")


def _check_together(arguments: argparse.Namespace) -> None:
    """What would not be looked at is refused."""
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
        raise UsageError(f"{option} is nothing to {what}", "leave it out; captain meter --help has what goes together")
