"""make clock: the station's time in emulated computers, whose pulses this one times."""

import argparse
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path

from tests.clock import delay, leap, pulses, steered
from tests.clock.bench import LateError
from tests.clock.machine import MADE, Made
from tests.clock.rows import Row

RESULTS = MADE / "results.json"


def main() -> int:
    arguments = _arguments()
    made = Made(arguments.kernel, arguments.initrd, arguments.device_tree, arguments.root)
    parts: dict[str, Callable[[], list[Row]]] = {
        "pulses": lambda: pulses.measure(made, arguments.pulses),
        "steered": lambda: steered.measure(made, arguments.calm_s, arguments.outage_s),
        "leap": lambda: leap.measure(made),
        "delay": lambda: delay.measure(made, arguments.calm_s),
    }
    rows: list[Row] = []
    for name, measure in parts.items():
        if name not in (arguments.only or parts):
            continue
        began = time.monotonic()
        print(f"{name}:", flush=True)
        found = _measured(measure)
        rows += found
        print(*found, sep="\n")
        print(f"        {time.monotonic() - began:.0f} s", flush=True)
    RESULTS.write_text(json.dumps([row._asdict() for row in rows], indent=1))
    missed = [row for row in rows if row.trouble]
    print(f"{len(rows) - len(missed)} of {len(rows)} figures meet their goal; rows: {RESULTS}")
    return 1 if missed or not rows else 0


def _measured(measure: Callable[[], list[Row]]) -> list[Row]:
    try:
        return measure()
    except LateError as error:
        return [Row("the bench", str(error), "an end", str(error))]


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="make clock", description=__doc__)
    parser.add_argument(
        "--only", action="append", choices=("pulses", "steered", "leap", "delay"), help="this part; again for more"
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
