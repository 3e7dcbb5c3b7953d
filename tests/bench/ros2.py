"""`make bench-ros2`: UPER -> CDR -> UPER in ns a message, beside typed messages of rclpy and asn1tools with rosbags.

A real message where there is one, else a made one of the corpus, the longest below 400 octets. All in one process and
alternating, in the ROS 2 of build/ros2/env; the rows of rclpy need message packages that are built: `make ros2`. What
the peers are spared stands in tests/ros2/inside/cdr_bench.py.
"""

import argparse
import json
import sys
import sysconfig
from collections.abc import Iterator

from asn1 import selection, text
from tests.bench.message_views import cases
from tests.fuzz import corpus
from tests.ros2 import codec, ros

GOAL = 100  # times asn1tools with rosbags
LONGEST = 400
TITLE = f"{'message':24}{'octets':>7}{'CDR':>6}{'to CDR':>11}{'back':>11}"
PEERS = {"rclpy": "rclpy, typed", "asn1tools": "asn1tools + rosbags"}


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.bench.ros2", description=__doc__)
    parser.add_argument("messages", nargs="*", help="default: all of the standard set")
    parser.add_argument("--rounds", type=int, default=5)
    arguments = parser.parse_args()
    schema = text.load_schema()
    names = selection.named(schema, arguments.messages) if arguments.messages else selection.standard(schema)
    folder = codec.made()
    print(TITLE + "".join(f"{title + ': there, back, ratios':>50}" for title in PEERS.values()) + "  goal")
    is_missed = False
    for name, octets in messages(names):
        said = ros.inside(
            "cdr_bench.py", folder, name, octets.hex(), str(arguments.rounds), sysconfig.get_path("purelib")
        )
        is_missed |= _print_row(name, octets, json.loads(said))
    return int(is_missed)


def messages(names: tuple[str, ...]) -> Iterator[tuple[str, bytes]]:
    """A message for each name; of the real ones each."""
    real = [(case.name, case.octets) for case in cases()]
    for name in names:
        found = [octets for edition, octets in real if edition == name]
        made = sorted((one for one in corpus.seeds(name) if len(one) < LONGEST), key=len)
        for octets in found or made[-1:]:
            yield name, octets


def _print_row(name: str, octets: bytes, said: dict[str, float]) -> bool:
    """Whether the goal is missed."""
    there, back = said["ours_to"], said["ours_from"]
    cells, ratios = "", []
    for peer in PEERS:
        if f"{peer}_to" not in said:
            cells += f"{'-':>50}"
            continue
        theirs = said[f"{peer}_to"], said[f"{peer}_from"]
        both = theirs[0] / there, theirs[1] / back
        cells += f"{theirs[0] / 1e3:>14.0f} us{theirs[1] / 1e3:>9.0f} us{both[0]:>12.0f} x{both[1]:>9.0f} x"
        if peer == "asn1tools":
            ratios = [*both]
    verdict = "" if not ratios else "reached" if min(ratios) >= GOAL else "MISSED"
    print(f"{name:24}{len(octets):>7}{said['cdr']:>6.0f}{there:>8.0f} ns{back:>8.0f} ns{cells}  {verdict}", flush=True)
    return verdict == "MISSED"


if __name__ == "__main__":
    sys.exit(main())
