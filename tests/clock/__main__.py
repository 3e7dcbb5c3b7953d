"""make clock: the station's time in emulated computers whose pulses the host times."""

import argparse
import sys

from tests.clock import pulses
from tests.clock.machine import Made


def main() -> int:
    parser = argparse.ArgumentParser(prog="make clock", description=__doc__)
    parser.add_argument("--count", type=int, default=12)
    arguments = parser.parse_args()
    for row in pulses.measure(Made(), arguments.count):
        print(row, row.trouble)
    return 0


if __name__ == "__main__":
    sys.exit(main())
