"""captain selftest: is each thing that the board file declares there, and does it work?"""

import argparse
import json
import logging
import signal
import sys
from collections.abc import Mapping
from contextlib import chdir, closing, nullcontext

from board.errors import StationError
from board.loop import Loop
from board.scratch import Scratch
from board.signals import Signals
from firmware import config
from firmware.lab import ports
from firmware.station import Station
from firmware.user import client, systemd
from firmware.user.arguments import add_configuration, add_socket, as_service
from firmware.user.table import Screen, Table
from firmware.user.untrusted import listed, text

DESCRIPTION = """\
Looks at each thing that the board file and the configuration declare: whether
it is present, whether it works, and what was measured. Nothing is switched
that the station would not switch by itself.

A station that runs on this machine with these options is asked; with --control
the one there, and no other. Where none runs, one is started for the test,
without users, and stopped again. Without options, where the station is a
service (captain.service, as on a box), they are the service's.
"""
EPILOG = """\
examples:
  captain selftest                              the running station
  captain selftest --control /run/captain.sock  the station of that socket
  captain selftest --board sim                  the simulated board
  captain selftest --board quad --json | jq '.[] | select(.works == false)'

exit codes:
  0    every declared capability works
  1    one does not, or the test could not be made
  2    wrong usage
"""
PATIENCE_S = 30.0  # of the whole test
NO_USERS = tuple(f"endpoint.{key}=0" for key in ("from_users", "to_users", "pull", "report"))


def arguments(parser: argparse.ArgumentParser) -> None:
    add_configuration(parser)
    add_socket(parser)
    parser.add_argument(
        "--json",
        action="store_true",
        help="a list of objects: capability, is_present, works (null: empty), value, remedy, ask (empty where no "
        "station runs that could be asked)",
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
    """Of the station that is meant; what a station may be asked afterwards is left out where that one has gone."""
    if arguments.control:
        return _asked(client.Address(), arguments.control)
    unit = as_service(arguments)
    with chdir(systemd.folder(unit)) if unit else nullcontext():
        return _configured(arguments)


def _configured(arguments: argparse.Namespace) -> list[dict[str, object]]:
    endpoint = config.load(arguments.config, arguments.overrides, arguments.board, arguments.defaults).tables.endpoint
    if ports.running(endpoint.from_users, endpoint.control) is not None:
        return _asked(client.Address(from_users=endpoint.from_users), endpoint.control)
    return [row | {"ask": ""} for row in listed(_alone(arguments), "rows")]


def _asked(place: client.Address, control: str) -> list[dict[str, object]]:
    return listed(client.ask_local(place, control, "selftest", PATIENCE_S), "rows")


def table(rows: list[dict[str, object]]) -> Table:
    """Rows as they are shown; what to do stands below."""
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
    """A slot with nobody in it, which nobody uses: there is nothing that could work."""
    return row.get("works", False) is None


def _alone(arguments: argparse.Namespace) -> Mapping[str, object]:
    """The answer of a station that runs for this test only, at ports that nobody knows.

    Raises StationError where there is none within PATIENCE_S, or it is told to stop before.
    """
    logging.basicConfig(level="ERROR", format="%(name)s: %(levelname)s: %(message)s", stream=sys.stderr)
    found: list[Mapping[str, object] | StationError] = []
    loop = Loop()

    def answered(answer: Mapping[str, object] | StationError) -> None:
        found.append(answer)
        loop.soon(loop.stop)  # it may come before the loop turns

    late = StationError(f"the self-test has no answer after {PATIENCE_S:g} s", "`captain doctor` looks at each part")
    loop.after(PATIENCE_S, lambda: answered(late))
    signals = Signals(loop, {signal.SIGTERM: lambda: answered(StationError("the self-test was told to stop"))})
    with closing(loop), closing(signals), closing(Scratch("captain-selftest-")) as scratch:
        own = f"endpoint.control={scratch.path / 'control'}"
        source = config.Source(
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
