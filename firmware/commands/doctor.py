"""captain doctor: checks all requirements of a station, and names remedies."""

import argparse
import json
import sys
import textwrap
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import chdir, nullcontext

from board.runtime import echo
from drivers.contract import Shared
from firmware import systemd
from firmware.client.arguments import add_configuration, as_service
from firmware.client.show.table import width_of
from firmware.codec import library
from firmware.config import captain_toml
from firmware.config.captain_toml import Config, InterfaceConfig
from firmware.doctor import board, checks, clock, mqtt, setup
from firmware.doctor.finding import Finding, Level
from firmware.lab import ports
from firmware.printable import clean
from firmware.station.station import topics_of
from firmware.systemd import Unit
from firmware.untrusted import within

DESCRIPTION = """\
Checks everything that `captain run` with the same options would need:

- configuration, ports, and the hardware that the board file names;
- each interface: its driver is started for a moment and stopped, or, if a
  station with this configuration runs, that station is asked. For an
  interface in a slot the device must be present. At a broker, certificates
  and access are checked;
- socket buffers of the kernel, clock and time sources, child processes,
  versions, and messages that can be decoded.

Without options, and with a service (captain.service, as on a box), the
service's configuration, defaults and board are used. The state of
the service and its last log lines are checked, too. With the package
captain-box, so are the settings that `captain box setup` makes.

Each line is ok, a warning (the station runs, with limits) or a problem, with
the remedy below it.
"""
EPILOG = """\
examples:
  captain doctor                                the service's station, or the
                                                simulated board
  captain doctor --config /etc/captain.toml --board none
  captain doctor --json | jq -r '.[] | select(.level != "ok") | .remedy'

exit codes:
  0    no problem; there may be warnings
  1    a problem
  2    wrong usage
"""
INDENT = " " * 9


def arguments(parser: argparse.ArgumentParser) -> None:
    add_configuration(parser)
    parser.add_argument("--json", action="store_true", help="print a list of objects: level, subject, text, remedy")


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
    """Yield all findings, the most basic first; unit: the installed service that has these options."""
    if unit is not None:
        yield from service(unit, systemd.journal)
    yield from checks.versions()
    yield from checks.clock(time.time())
    yield from checks.worker(echo.try_out)
    yield from checks.codec(library.load)
    read, found = checks.configuration(
        lambda: captain_toml.load(arguments.config, arguments.overrides, arguments.board, arguments.defaults)
    )
    yield from found
    if read is None:
        return
    endpoint = read.tables.endpoint
    running = ports.running(endpoint.from_users, endpoint.control)
    is_service, is_served = unit is not None, unit is not None and systemd.is_active(unit)
    yield from checks.endpoint(endpoint, running, is_served)
    yield from board.board(read.board, is_service=is_service)
    if is_service:
        yield from setup.missing()
    if not is_served:
        yield from checks.neighbours(read.board, running)
    is_beside = running is not None and checks.has_other(running, read.digest)
    for interface in read.interfaces:
        yield from _interface(interface, read, None if is_beside else running, is_service, is_beside)
    yield from clock.time(read, running, time.time())
    yield from checks.signatures(read.tables.reception)
    yield from checks.receive_buffer(read.interfaces)


def service(unit: Unit, journal: Callable[[], str]) -> Iterator[Finding]:
    """Report whether the service runs, and whether it was restarted; journal is read only after a problem."""
    told = systemd.state(unit)
    if systemd.is_active(unit) and not systemd.restarts(unit):
        yield Finding(Level.OK, "service", told)
        return
    is_starting = unit.get("ActiveState") == "activating" and not systemd.restarts(unit)
    level = Level.WARNING if systemd.is_active(unit) or is_starting else Level.PROBLEM
    words = "" if is_starting else systemd.last_words(journal())
    yield Finding(level, "service", f"{told}; its last words: {words}" if words else told, systemd.remedy(unit))


def _interface(
    interface: InterfaceConfig, read: Config, running: Mapping[str, object] | None, is_service: bool, is_beside: bool
) -> Iterator[Finding]:
    yield from checks.pin_file(interface)
    shared = Shared(read.mac, types=tuple(kind.name for kind in topics_of(read.tables).kinds))
    is_running = interface.name in within(running or {}, "interfaces")
    is_whole = True
    if mqtt.is_one(interface):
        closed = list(mqtt.closed(interface)) if is_service else []
        files = closed or list(mqtt.files(interface, shared, time.time()))
        yield from files
        is_whole = not closed and all(finding.level is not Level.PROBLEM for finding in files)
        is_placed = read.tables.station.position is not None
        yield from mqtt.position(interface, shared, read.interfaces, is_placed)
    if interface.queue.slot and not is_running:
        yield from board.slot_of(interface, read.board)
    elif mqtt.is_one(interface) and not is_running:
        # A trial connection would report the problem of the files again.
        yield from mqtt.reach(interface, shared) if is_whole else ()
    else:
        yield from checks.interface(interface, read.mac, running, is_service, is_beside)


def lines(finding: Finding, width: int) -> list[str]:
    """Return a finding as lines, with the remedy below it."""
    told: list[str] = []
    for line in f"{finding.subject}: {finding.text}".split("\n"):  # a configuration file may have several errors
        first = INDENT if told else f"{finding.level.value:9}"
        told += textwrap.wrap(clean(line), width, initial_indent=first, subsequent_indent=INDENT)
    remedy = textwrap.wrap(
        clean(finding.remedy), width, initial_indent=INDENT + "-> ", subsequent_indent=INDENT + "   "
    )
    return told + remedy
