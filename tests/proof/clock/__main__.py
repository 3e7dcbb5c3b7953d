"""make clock: the station's time in emulated computers, whose pulses this one times."""

import argparse
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path

from tests.proof.clock import delay, leap, pulses, steered
from tests.proof.clock.card import Card
from tests.proof.clock.machine import MADE, Kind, LateError, Made
from tests.proof.clock.rows import Row

PARTS: dict[str, Callable[[Kind, argparse.Namespace], list[Row]]] = {
    "pulses": lambda made, given: pulses.measure(made, given.pulses),
    "steered": lambda made, given: steered.measure(made, given.calm_s, given.outage_s),
    "leap": lambda made, given: leap.measure(made),
    "delay": lambda made, given: delay.measure(made, given.calm_s),
}
RESULTS = MADE / "results.json"
OF_CARD = ("pulses", "steered", "leap")  # a card has one network


def main() -> int:
    arguments = _arguments()
    made: Kind = Made(arguments.kernel, arguments.initrd, arguments.device_tree, arguments.root)
    if arguments.card:
        made = Card(arguments.card)
    rows: list[Row] = []
    for name in arguments.only or (OF_CARD if arguments.card else PARTS):
        began = time.monotonic()
        print(f"{name}:", flush=True)
        found = _measured(name, made, arguments)
        rows += found
        print(*found, sep="\n")
        print(f"        {time.monotonic() - began:.0f} s", flush=True)
    RESULTS.write_text(json.dumps([row._asdict() for row in rows], indent=1))
    missed = [row for row in rows if row.trouble]
    print(f"{len(rows) - len(missed)} of {len(rows)} figures meet their goal; rows: {RESULTS}")
    return 1 if missed or not rows else 0


def _measured(name: str, made: Kind, arguments: argparse.Namespace) -> list[Row]:
    try:
        return PARTS[name](made, arguments)
    except LateError as error:
        return [Row("the bench", str(error), "an end", str(error))]


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="make clock", description=__doc__)
    parser.add_argument("--only", action="append", choices=tuple(PARTS), help="this part; again for more")
    parser.add_argument(
        "--card", metavar="FILE", type=Path, help=f"a card in place of the bench's own Linux: {', '.join(OF_CARD)}"
    )
    parser.add_argument("--pulses", type=int, default=30, help="how many of them (default 30)")
    parser.add_argument(
        "--calm-s",
        metavar="S",
        type=float,
        default=60.0,
        help="at rest in steered, and of messages in delay (default 60)",
    )
    parser.add_argument("--outage-s", metavar="S", type=float, default=60.0, help="without satellites (default 60)")
    for name, path in vars(Made()).items():
        parser.add_argument(f"--{name.replace('_', '-')}", type=Path, default=path, help="of the guest")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
