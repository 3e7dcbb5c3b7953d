"""captain slot: what sits in the slots of the board, and their power."""

import argparse
import json
import sys
import time

from board.errors import StationError, UsageError
from firmware.printable import clean
from firmware.user import board, client
from firmware.user.arguments import add_control, address
from firmware.user.table import Screen
from firmware.user.untrusted import named, text

DESCRIPTION = """\
Lists the slots of the board under a running station of this machine, or
switches one of them. Only the station touches power; this command asks it.

`off` stays until `on`, also when something is plugged in. `on` and `cycle`
end a fault. A slot is given by its name or by its number, from 1 on.
"""
EPILOG = """\
examples:
  captain slot list
  captain slot cycle cellular --wait       until its driver runs again
  captain slot off 4
  captain slot list --json | jq '.cellular.state'

states:
  unused    no interface has it; its power is left as it was found
  off       switched off by an operator
  powering  its power is on, its device is waited for
  starting  its device is there, its driver is being started
  running   its driver runs
  cycling   without power for a moment
  empty     switched on, no interface has it, and nothing is plugged in: what
            is plugged in later is seen
  fault     given up: the cause stays until a device is plugged in, or until
            `captain slot on` or `cycle`

exit codes:
  0    done
  1    no station answers, there is no such slot, or with --wait it did not run
  2    wrong usage
"""
PATIENCE_S = 120.0  # of --wait: a cellular module needs 30 s after its power, and may need a power cycle more
LOOK_S = 0.25
ENDS = {"running": 0, "off": 0, "unused": 0, "empty": 1, "fault": 1}


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("ask", choices=("list", "on", "off", "cycle"), help="what to do")
    parser.add_argument("slot", nargs="?", default="", help="which one; not with list")
    parser.add_argument(
        "--wait",
        action="store_true",
        help="return when it runs, is off, is empty or has a fault; until then each change is told on stderr",
    )
    parser.add_argument("--json", action="store_true", help="one JSON object, by the names of the slots")
    add_control(parser)


def main(arguments: argparse.Namespace) -> int:
    if (arguments.ask == "list") is bool(arguments.slot):
        raise UsageError(f"slot {arguments.ask}: name {'no slot' if arguments.slot else 'a slot, or its number'}")
    slots = _ask(arguments, arguments.ask, arguments.slot)
    code = 0
    if arguments.wait and arguments.slot:
        slots, code = _wait(arguments, next(iter(slots)))
    if arguments.json:
        print(json.dumps(slots))
    else:
        Screen().show([board.slots({"slots": slots})])
    return code


def _ask(arguments: argparse.Namespace, ask: str, slot: str = "") -> dict[str, object]:
    slots = client.ask_local(address(arguments), arguments.control, "slot", ask=ask, slot=slot).get("slots")
    return slots if isinstance(slots, dict) else {}


def _wait(arguments: argparse.Namespace, name: str) -> tuple[dict[str, object], int]:
    """Look at a slot until it has come to rest, and say what it does. Raises StationError when it does not."""
    end = time.monotonic() + PATIENCE_S
    said = ""
    while time.monotonic() < end:
        for found, one in named({"slots": _ask(arguments, "list")}, "slots"):
            if found != name:
                continue
            if text(one, "state") in ENDS:
                return {name: one}, ENDS[text(one, "state")]
            if (progress := clean(f"slot {name}: {text(one, 'state')}: {text(one, 'why')}")) != said:
                print(progress, file=sys.stderr, flush=True)
                said = progress
        time.sleep(LOOK_S)
    raise StationError(f"slot {name} has not come to rest within {PATIENCE_S:g} s", "see `captain status`")
