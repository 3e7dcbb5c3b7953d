"""Start of a benchmark: its options and required programs."""

import argparse
import os
import signal
import sys
from collections.abc import Callable

from tests.bench import programs


def begin(
    name: str, about: str | None, pairs: int, captain: str, add: Callable[[argparse.ArgumentParser], object]
) -> argparse.Namespace:
    """Options of every such program, and what add() adds; PAIRS, SCALE and CAPTAIN of the environment are defaults.

    pairs    where neither says it. captain: the command that is measured, the same.

    Compiles what is not up to date; ends the program where something for that is missing.
    """
    parser = argparse.ArgumentParser(prog=f"python -m {name}", description=about)
    parser.add_argument("--pairs", type=int, default=int(os.environ.get("PAIRS", str(pairs))))
    parser.add_argument("--scale", type=float, default=float(os.environ.get("SCALE", "1")))
    parser.add_argument(
        "--captain", default=os.environ.get("CAPTAIN", "") or captain, help="the command that is measured"
    )
    add(parser)
    arguments = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # ends what is measured, too
    try:
        programs.build()
    except programs.MissingToolError as error:
        print(f"bench: {error}", file=sys.stderr)
        sys.exit(1)
    return arguments
