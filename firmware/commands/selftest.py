"""captain selftest: is each thing that the board file declares there, and does it work?"""

import argparse
import json
import logging
import signal
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

from board.errors import StationError
from board.loop import Loop
from board.signals import Signals
from firmware import config
from firmware.lab import ports
from firmware.station import Station
from firmware.user import client
from firmware.user.arguments import add_configuration
from firmware.user.table import Screen, Table
from firmware.user.untrusted import listed, text

DESCRIPTION = """\
Looks at each thing that the board file and the configuration declare: whether
it is present, whether it works, and what was measured. Nothing is switched
that the station would not switch by itself.

A station that runs on this machine with these options is asked. Where none
runs, one is started for the test, without users, and stopped again.
"""
EPILOG = """\
examples:
  captain selftest                              the running station
  captain selftest --board sim                  the simulated board
  captain selftest --board quad --json | jq '.[] | select(.works | not)'

exit codes:
  0    every declared capability works
  1    one does not, or the test could not be made
  2    wrong usage
"""
PATIENCE_S = 30.0  # of the whole test
NO_USERS = tuple(f"endpoint.{key}=0" for key in ("from_users", "to_users", "pull", "report"))


def arguments(parser: argparse.ArgumentParser) -> None:
    add_configuration(parser)
    parser.add_argument("--json", action="store_true", help="a list of objects: capability, is_present, works, value")


def main(arguments: argparse.Namespace) -> int:
    read = config.load(arguments.config, arguments.overrides, arguments.board)
    endpoint = read.tables.endpoint
    if ports.running(endpoint.from_users, endpoint.control) is not None:
        place = client.Address(from_users=endpoint.from_users)
        rows = listed(client.ask_local(place, endpoint.control, "selftest", PATIENCE_S), "rows")
    else:
        rows = listed(_alone(arguments), "rows")
    if arguments.json:
        print(json.dumps(rows, indent=1))
    else:
        Screen().show([table(rows)])
    return 0 if rows and all(row.get("works") is True for row in rows) else 1


def table(rows: list[dict[str, object]]) -> Table:
    """Rows as they are shown; what to do stands below."""
    shown = [
        (
            text(row, "capability"),
            "yes" if row.get("is_present") is True else "no",
            "yes" if row.get("works") is True else "NO",
            text(row, "value"),
        )
        for row in rows
    ]
    wrong = [row for row in rows if row.get("works") is not True]
    notes = [f"{text(row, 'capability')}: {text(row, 'remedy')}" for row in wrong if text(row, "remedy")]
    title = f"{len(rows) - len(wrong)} of {len(rows)} capabilities work" if rows else "nothing is declared"
    return Table(title, ("capability", "present", "works", "measured"), shown, notes)


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
    with tempfile.TemporaryDirectory(prefix="captain-selftest-") as folder:
        control = f"endpoint.control={Path(folder) / 'control'}"
        overrides = [*arguments.overrides, *NO_USERS, control]
        wanted = config.load(arguments.config, overrides, arguments.board)
        station = Station(loop, wanted, lambda: wanted)
        try:
            station.start()
            station.selftest(answered)
            loop.run()
        finally:
            station.close()
            signals.close()
            loop.close()
    answer = found[0]
    if isinstance(answer, StationError):
        raise answer
    return answer
