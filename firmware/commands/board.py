"""captain board: shows the board of a station, its measurements and its start."""

import argparse
import json
import sys
from collections.abc import Iterator, Mapping

from firmware.client import client
from firmware.client.arguments import add_control, address
from firmware.client.show.status import board
from firmware.client.show.table import Screen, Table, lines_of, plain, width_of
from firmware.untrusted import listed, number, text, texts, within

DESCRIPTION = """\
Shows the board of a running station on this machine: identity, slots with
their devices, rails, temperatures, fan, and problems.

The time line of the start shows what each module waited for. On a terminal
only the part that fits is shown, the latest last.
"""
EPILOG = """\
examples:
  captain board show
  captain board show | less                the whole time line
  captain board show --json | jq '.board.rails'

exit codes:
  0    the station answered
  1    no station answers
  2    wrong usage
"""


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("ask", choices=("show",), help="action")
    parser.add_argument("--json", action="store_true", help="one JSON object: board and timeline")
    add_control(parser)


def main(arguments: argparse.Namespace) -> int:
    answer = client.ask_local(address(arguments), arguments.control, "board")
    if arguments.json:
        print(json.dumps({key: answer.get(key) for key in ("board", "timeline")}))
    else:
        Screen().show(fitting(list(tables(answer)), width_of(sys.stdout), lines_of(sys.stdout)))
    return 0


def fitting(shown: list[Table], width: int, height: int) -> list[Table]:
    """Return the tables with a shortened time line, so that all fit the terminal; the time line keeps its end."""
    *above, line = shown
    whole = [len(plain(table, width)) + 1 for table in shown]
    if sum(whole) <= height:
        return shown
    kept = max(0, height - sum(whole[:-1]) - 4)  # 4: title, headings, note and an empty line
    note = f"the last {kept} of {len(line.rows)}; `captain board show | less` has all"
    return [*above, line._replace(rows=line.rows[len(line.rows) - kept :], notes=[note])]


def tables(answer: Mapping[str, object]) -> Iterator[Table]:
    """Yield the tables of an answer to `board`."""
    told = within(answer, "board")
    if told:
        yield Table(board.title(told))
        yield board.slots(told)
        yield Table("", ("measured", "name", "value", ">s ago"), board.measured(told))
        yield from ([Table("wrong", notes=texts(told, "complaints"))] if texts(told, "complaints") else [])
    else:
        yield Table("the board file declares no hardware")
    rows = [(f"{number(one, 'at_s'):.2f}", text(one, "who"), text(one, "what")) for one in listed(answer, "timeline")]
    yield Table("start" if rows else "nothing has come up yet", (">s", "who", "what"), rows)
