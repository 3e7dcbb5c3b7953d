"""captain slot: lists the slots of the board and switches their power."""

import argparse
import json
import sys
import time

from board.runtime.errors import StationError, UsageError
from firmware.client import client
from firmware.client.arguments import add_control, address
from firmware.client.show.status import board
from firmware.client.show.table import Screen
from firmware.printable import clean
from firmware.untrusted import named, text

DESCRIPTION = """\
Lists the slots of the board of a running station on this machine, or switches
one of them. The station itself switches the power.

A slot that is `off` stays off until `on`, even if a module is plugged in. `on`
and `cycle` clear a fault. A slot is given by its name or its number (from 1).
"""
EPILOG = """\
examples:
  captain slot list
  captain slot cycle cellular --wait       return when its driver runs again
  captain slot off 4
  captain slot list --json | jq '.cellular.state'

states:
  unused    no interface uses it; its power is not changed
  off       switched off by an operator
  powering  power is on, waiting for the device
  starting  device present, starting the driver
  running   driver running
  cycling   power is off for a moment
  empty     switched on, but no interface uses it and no device is present;
            a device is detected when it is plugged in
  fault     given up, until a device is plugged in or `captain slot on` or
            `cycle` is run

exit codes:
  0    done
  1    no station answers, the slot is unknown, or with --wait it did not run
  2    wrong usage
"""
PATIENCE_S = 120.0  # time limit of --wait in seconds: a cellular module needs 30 s, and may need another power cycle
LOOK_S = 0.25
ENDS = {"running": 0, "off": 0, "unused": 0, "empty": 1, "fault": 1}


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("ask", choices=("list", "on", "off", "cycle"), help="action; list needs no SLOT")
    parser.add_argument("slot", nargs="?", default="", help="which one; not with list")
    parser.add_argument(
        "--wait",
        action="store_true",
        help="wait until it runs, is off, is empty or has a fault; changes are printed on stderr",
    )
    parser.add_argument("--json", action="store_true", help="one JSON object, by slot name")
    add_control(parser)


def main(arguments: argparse.Namespace) -> int:
    """Show slots, or switch one.

    Raises UsageError for a slot with `list`, or without one for other actions; StationError if --wait exceeds
    PATIENCE_S.
    """
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
    """Wait until a slot reaches a final state, and print each change; return its status and the exit code.

    Raises StationError after PATIENCE_S.
    """
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
