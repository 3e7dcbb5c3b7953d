"""make ros2: message packages in a real ROS 2, and what other parts find there."""

import argparse
import fcntl
import sys
import time
from collections.abc import Callable, Iterable

from asn1.backends.ros2.model import RosPackage
from asn1.backends.ros2.options import PROFILES
from tests.proof.ros2 import cdr, debian, gateway, guide, hashes, packages, recording, ros, typed, wheel
from tests.proof.ros2.ros import RosError
from tests.proof.ros2.rows import Row

PARTS: dict[str, Callable[[list[RosPackage]], Iterable[Row]]] = {
    "hashes": hashes.compare,
    "cdr": cdr.compare,
    "wheel": wheel.install,
    "packages": packages.build,
    "typed": typed.travel,
    "debian": debian.build,
    "recording": recording.read,
    "gateway": gateway.run,
    "guide": guide.run,
}


def main() -> int:
    arguments = _arguments()
    with (ros.MADE / "run.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # there is one workspace
        return _run(arguments)


def _run(arguments: argparse.Namespace) -> int:
    editions = packages.SHORT if arguments.short else tuple(arguments.message or packages.SCHEMA.messages)
    made = packages.made(editions, arguments.profile)
    rows: list[Row] = []
    if not arguments.keep and "packages" in (arguments.only or PARTS):
        packages.clean()
    for name in arguments.only or PARTS:
        print(f"{name}:", flush=True)
        began = time.monotonic()
        for row in _rows(name, made):
            print(row, flush=True)
            rows.append(row)
        print(f"          {time.monotonic() - began:.0f} s", flush=True)
    missed = [row for row in rows if row.trouble]
    print(f"{len(rows) - len(missed)} of {len(rows)} meet their goal")
    return 1 if missed or not rows else 0


def _rows(name: str, made: list[RosPackage]) -> Iterable[Row]:
    """Of a part, as they come."""
    try:
        yield from PARTS[name](made)
    except RosError as error:
        yield Row(name, "ended early", str(error))


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="make ros2", description=__doc__)
    parser.add_argument("--only", action="append", choices=tuple(PARTS), metavar="PART", help=f"of {', '.join(PARTS)}")
    parser.add_argument("--profile", choices=PROFILES, default="etsi_its", help="whose names; default: %(default)s")
    parser.add_argument("--short", action="store_true", help=f"with {' and '.join(packages.SHORT)} alone")
    parser.add_argument(
        "--message", action="append", metavar="NAME", help="with this edition: cam-1.4.1; again for more"
    )
    parser.add_argument(
        "--keep", action="store_true", help="what has been built: only what is new is compiled, and all is looked at"
    )
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
