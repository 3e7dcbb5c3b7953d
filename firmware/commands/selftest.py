"""captain selftest: tests each part of the board and each interface."""

import argparse
import json
import logging
import signal
import sys
from collections.abc import Mapping
from contextlib import chdir, closing, nullcontext

from board.runtime.errors import StationError
from board.runtime.loop import Loop
from board.runtime.scratch import Scratch
from board.runtime.signals import Signals
from firmware import systemd
from firmware.client import client
from firmware.client.arguments import add_configuration, add_socket, as_service
from firmware.client.show.table import Screen, Table
from firmware.config import captain_toml
from firmware.lab import ports
from firmware.station.station import Station
from firmware.untrusted import listed, text

DESCRIPTION = """\
Tests each part that the board file and the configuration declare: is it
present, does it work, what was measured. The test switches nothing that the
station would not switch anyway.

A running station with these options executes the test; with --control the
station of that socket. If none runs, one is started without users for the
test. Without options, the options of the service apply (captain.service, as on
a box).
"""
EPILOG = """\
examples:
  captain selftest                              the running station
  captain selftest --control /run/captain.sock  the station of that socket
  captain selftest --board sim                  the simulated board
  captain selftest --board quad --json | jq '.[] | select(.works == false)'

exit codes:
  0    every declared capability works
  1    one does not work, or the test was not possible
  2    wrong usage
"""
PATIENCE_S = 30.0  # time limit of the whole test
NO_USERS = tuple(f"endpoint.{key}=0" for key in ("from_users", "to_users", "pull", "report"))


def arguments(parser: argparse.ArgumentParser) -> None:
    add_configuration(parser)
    add_socket(parser)
    parser.add_argument(
        "--json",
        action="store_true",
        help="a list of objects: capability, is_present, works (null: empty), value, remedy, ask (empty "
        "without a running station)",
    )


def main(arguments: argparse.Namespace) -> int:
    rows = _rows(arguments)
    if arguments.json:
        print(json.dumps(rows, indent=1))
    else:
        Screen().show([table(rows)])
    judged = [row for row in rows if not _is_empty(row)]
    return 0 if judged and all(row.get("works") is True for row in judged) else 1


def _rows(arguments: argparse.Namespace) -> list[dict[str, object]]:
    """Return the rows of the running station, or of a temporary one, whose rows have no `ask`."""
    if arguments.control:
        return _asked(client.Address(), arguments.control)
    unit = as_service(arguments)
    with chdir(systemd.folder(unit)) if unit else nullcontext():
        return _configured(arguments)


def _configured(arguments: argparse.Namespace) -> list[dict[str, object]]:
    endpoint = captain_toml.load(
        arguments.config, arguments.overrides, arguments.board, arguments.defaults
    ).tables.endpoint
    if ports.running(endpoint.from_users, endpoint.control) is not None:
        return _asked(client.Address(from_users=endpoint.from_users), endpoint.control)
    return [row | {"ask": ""} for row in listed(_alone(arguments), "rows")]


def _asked(place: client.Address, control: str) -> list[dict[str, object]]:
    return listed(client.ask_local(place, control, "selftest", PATIENCE_S), "rows")


def table(rows: list[dict[str, object]]) -> Table:
    """Return the table of capabilities, with the remedies below it."""
    shown = [
        (
            text(row, "capability"),
            "yes" if row.get("is_present") is True else "no",
            "" if _is_empty(row) else "yes" if row.get("works") is True else "NO",
            text(row, "value"),
        )
        for row in rows
    ]
    judged = [row for row in rows if not _is_empty(row)]
    wrong = [row for row in judged if row.get("works") is not True]
    told = [
        (text(row, "capability"), "; ".join(filter(None, (text(row, "remedy"), text(row, "ask"))))) for row in wrong
    ]
    notes = [f"{capability}: {what}" for capability, what in told if what]
    title = f"{len(judged) - len(wrong)} of {len(judged)} capabilities work" if rows else "nothing is declared"
    return Table(title, ("capability", "present", "works", "measured"), shown, notes)


def _is_empty(row: Mapping[str, object]) -> bool:
    """Whether the row is an empty slot that no interface uses."""
    return row.get("works", False) is None


def _alone(arguments: argparse.Namespace) -> Mapping[str, object]:
    """Return the answer of a temporary station without users, which runs for this test only.

    Raises StationError if no answer comes within PATIENCE_S, and if the test is stopped.
    """
    logging.basicConfig(level="ERROR", format="%(name)s: %(levelname)s: %(message)s", stream=sys.stderr)
    found: list[Mapping[str, object] | StationError] = []
    loop = Loop()

    def answered(answer: Mapping[str, object] | StationError) -> None:
        found.append(answer)
        loop.soon(loop.stop)  # the answer may come before the loop runs

    late = StationError(f"no answer to the self-test after {PATIENCE_S:g} s", "`captain doctor` looks at each part")
    loop.after(PATIENCE_S, lambda: answered(late))
    signals = Signals(loop, {signal.SIGTERM: lambda: answered(StationError("the self-test was stopped"))})
    with closing(loop), closing(signals), closing(Scratch("captain-selftest-")) as scratch:
        own = f"endpoint.control={scratch.path / 'control'}"
        source = captain_toml.ConfigSource(
            arguments.config, (*arguments.overrides, *NO_USERS, own), arguments.board, arguments.defaults
        )
        station = Station(loop, source.load(), source)
        try:
            station.start()
            station.selftest(answered)
            loop.run()
        finally:
            station.close()
    answer = found[0]
    if isinstance(answer, StationError):
        raise answer
    return answer
