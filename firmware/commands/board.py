"""captain board: what the board under the station is, and what it measures."""

import argparse
import json
import sys
from collections.abc import Iterator, Mapping

from firmware.user import board, client
from firmware.user.arguments import add_control, address
from firmware.user.table import Screen, Table, lines_of, plain, width_of
from firmware.user.untrusted import listed, number, text, texts, within

DESCRIPTION = """\
Shows the board under a running station of this machine: its identity, its
slots with what sits in them, rails, temperatures and fan as they were read
last, what is wrong with them, and the time line of the station's start with
what each module waited for: on a terminal as much of its end as fits.
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
    parser.add_argument("ask", choices=("show",), help="what to do")
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
    """What fits into a terminal: the time line, which is the last, keeps its end."""
    *above, line = shown
    whole = [len(plain(table, width)) + 1 for table in shown]
    if sum(whole) <= height:
        return shown
    kept = max(0, height - sum(whole[:-1]) - 4)  # beside its title, heads and note, and an empty line behind
    note = f"the last {kept} of {len(line.rows)}; `captain board show | less` has all"
    return [*above, line._replace(rows=line.rows[len(line.rows) - kept :], notes=[note])]


def tables(answer: Mapping[str, object]) -> Iterator[Table]:
    """What is shown of an answer to `board`."""
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
