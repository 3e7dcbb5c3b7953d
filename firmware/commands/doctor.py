"""captain doctor: looks at what a station needs, and says what to do about what it lacks."""

import argparse
import json
import sys
import textwrap
import time
from collections.abc import Iterator

from board import echo
from drivers.contract import Shared
from firmware import config
from firmware.codec import library
from firmware.lab import board_checks, checks, mqtt_checks, ports, time_checks
from firmware.lab.checks import Finding, Level
from firmware.printable import clean
from firmware.station import topics_of
from firmware.user.arguments import add_configuration
from firmware.user.table import width_of
from firmware.user.untrusted import within

DESCRIPTION = """\
Looks at everything that `captain run` with the same options would need: the
configuration, the ports, what the board file names, each interface (its driver
is started for a moment and stopped; where a station runs already, that one is
asked; of one in a slot its device is looked for; of one at a broker its
certificates, and whether the broker accepts it), what the kernel lets sockets
keep, the clock, where its time comes from, child processes, versions; and
which messages can be decoded.

Each line is ok, a warning (it runs, but not as well), or a problem, with what
to do about it below.
"""
EPILOG = """\
examples:
  captain doctor                                the default, simulated board
  captain doctor --config /etc/captain.toml --board none
  captain doctor --json | jq -r '.[] | select(.level != "ok") | .remedy'

exit codes:
  0    no problem, perhaps warnings
  1    a problem
  2    wrong usage
"""
INDENT = " " * 9


def arguments(parser: argparse.ArgumentParser) -> None:
    add_configuration(parser)
    parser.add_argument("--json", action="store_true", help="a list of objects: level, subject, text, remedy")


def main(arguments: argparse.Namespace) -> int:
    found = []
    for finding in examine(arguments):
        found.append(finding)
        if not arguments.json:
            print("\n".join(lines(finding, width_of(sys.stdout))), flush=True)
    if arguments.json:
        print(json.dumps([finding._asdict() | {"level": finding.level.value} for finding in found], indent=1))
    problems = sum(finding.level is Level.PROBLEM for finding in found)
    warnings = sum(finding.level is Level.WARNING for finding in found)
    if not arguments.json:
        print(f"problems: {problems}, warnings: {warnings}")
    return 1 if problems else 0


def examine(arguments: argparse.Namespace) -> Iterator[Finding]:
    """All findings, in the order in which one would look."""
    yield from checks.versions()
    yield from checks.clock(time.time())
    yield from checks.worker(echo.try_out)
    yield from checks.codec(library.load)
    read, found = checks.configuration(
        lambda: config.load(arguments.config, arguments.overrides, arguments.board, arguments.defaults)
    )
    yield from found
    if read is None:
        return
    endpoint = read.tables.endpoint
    running = ports.running(endpoint.from_users, endpoint.control)
    yield from checks.endpoint(endpoint, running)
    yield from board_checks.board(read.board)
    yield from checks.neighbours(read.board, running)
    shared = Shared(read.mac, types=tuple(kind.name for kind in topics_of(read.tables).kinds))
    for interface in read.interfaces:
        yield from checks.pin_file(interface)
        is_running = interface.name in within(running or {}, "interfaces")
        is_whole = True
        if mqtt_checks.is_one(interface):
            files = list(mqtt_checks.files(interface, shared, time.time()))
            yield from files
            is_whole = all(finding.level is not Level.PROBLEM for finding in files)
            is_placed = read.tables.station.position is not None
            yield from mqtt_checks.position(interface, shared, read.interfaces, is_placed)
        if interface.queue.slot and not is_running:
            yield from board_checks.slot_of(interface, read.board)
        elif mqtt_checks.is_one(interface) and not is_running:
            yield from mqtt_checks.reach(interface, shared) if is_whole else ()  # which would tell the same again
        else:
            yield from checks.interface(interface, read.mac, running)
    yield from time_checks.time(read, running, time.time())
    yield from checks.receive_buffer(read.interfaces)


def lines(finding: Finding, width: int) -> list[str]:
    """A finding on the screen, the remedy below it."""
    told: list[str] = []
    for line in f"{finding.subject}: {finding.text}".split("\n"):  # a file may have several mistakes
        first = INDENT if told else f"{finding.level.value:9}"
        told += textwrap.wrap(clean(line), width, initial_indent=first, subsequent_indent=INDENT)
    remedy = textwrap.wrap(
        clean(finding.remedy), width, initial_indent=INDENT + "-> ", subsequent_indent=INDENT + "   "
    )
    return told + remedy
