"""captain doctor: looks at what a station needs, and says what to do about what it lacks."""

import argparse
import json
import sys
import textwrap
import time
from collections.abc import Iterator, Mapping
from contextlib import chdir, nullcontext

from board import echo
from drivers.contract import Shared
from firmware import config
from firmware.codec import library
from firmware.config import Config, InterfaceConfig
from firmware.lab import board_checks, checks, mqtt_checks, ports, service_checks, time_checks
from firmware.lab.checks import Finding, Level
from firmware.printable import clean
from firmware.station import topics_of
from firmware.user import systemd
from firmware.user.arguments import add_configuration, as_service
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

Without options, where the station is a service (captain.service, as on a box),
it takes the configuration, defaults and board that the service takes, and
tells how the service does, with the station's last words.

Each line is ok, a warning (it runs, but not as well), or a problem, with what
to do about it below.
"""
EPILOG = """\
examples:
  captain doctor                                the service's station; without
                                                one the simulated board
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
    unit = as_service(arguments)
    found = []
    with chdir(systemd.folder(unit)) if unit else nullcontext():
        for finding in examine(arguments, unit):
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


def examine(arguments: argparse.Namespace, unit: systemd.Unit | None = None) -> Iterator[Finding]:
    """All findings, in the order in which one would look. unit: the service that has these options."""
    if unit is not None:
        yield from service_checks.service(unit, systemd.journal)
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
    is_service, is_served = unit is not None, unit is not None and systemd.is_active(unit)
    yield from checks.endpoint(endpoint, running, is_served)
    yield from board_checks.board(read.board, is_service=is_service)
    if not is_served:
        yield from checks.neighbours(read.board, running)
    for interface in read.interfaces:
        yield from _interface(interface, read, running, is_service)
    yield from time_checks.time(read, running, time.time())
    yield from checks.signatures(read.tables.reception)
    yield from checks.receive_buffer(read.interfaces)


def _interface(
    interface: InterfaceConfig, read: Config, running: Mapping[str, object] | None, is_service: bool
) -> Iterator[Finding]:
    yield from checks.pin_file(interface)
    shared = Shared(read.mac, types=tuple(kind.name for kind in topics_of(read.tables).kinds))
    is_running = interface.name in within(running or {}, "interfaces")
    is_whole = True
    if mqtt_checks.is_one(interface):
        closed = list(mqtt_checks.closed(interface)) if is_service else []
        files = closed or list(mqtt_checks.files(interface, shared, time.time()))
        yield from files
        is_whole = not closed and all(finding.level is not Level.PROBLEM for finding in files)
        is_placed = read.tables.station.position is not None
        yield from mqtt_checks.position(interface, shared, read.interfaces, is_placed)
    if interface.queue.slot and not is_running:
        yield from board_checks.slot_of(interface, read.board)
    elif mqtt_checks.is_one(interface) and not is_running:
        yield from mqtt_checks.reach(interface, shared) if is_whole else ()  # which would tell the same again
    else:
        yield from checks.interface(interface, read.mac, running, is_service)


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
