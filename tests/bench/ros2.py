"""UPER to CDR and back, beside rclpy and asn1tools with rosbags.

A real message if there is one, else a made one: the longest below 400 octets that asn1tools reads completely. To
report incomplete ones takes as long as everything else, or longer. All run in one process, alternating, in the ROS 2
of build/ros2/env. The rows of rclpy need built message packages: `make ros2`. tests/proof/ros2/inside/cdr_bench.py
says what the peers need not do.
"""

import argparse
import importlib
import json
import sys
import sysconfig
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from asn1.model import selection, text
from asn1.model.types import Schema
from tests.asn1.values import Values
from tests.bench.message_views import cases
from tests.proof.ros2 import codec, ros

GOAL = 100  # times asn1tools with rosbags, there and back together
LONGEST = 400
MADE = 200
TRIED = 20
TITLE = f"{'message':24}{'octets':>7}{'CDR':>6}{'to CDR':>11}{'back':>11}"
PEERS = {"rclpy": "rclpy, typed", "asn1tools": "asn1tools + rosbags"}


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.bench.ros2", description=__doc__)
    parser.add_argument("messages", nargs="*", help="default: all of the standard set")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--prefix", type=Path, default=ros.INSTALLED, help="where message packages are installed")
    arguments = parser.parse_args()
    schema = text.load_schema()
    names = selection.named(schema, arguments.messages) if arguments.messages else selection.standard(schema)
    folder = codec.made()
    print(TITLE + "".join(f"{title + ': there, back, ratios':>50}" for title in PEERS.values()) + "  goal")
    is_missed = False
    sys.path.insert(0, str(folder))
    for name, candidates in messages(schema, names):
        octets = ",".join(one.hex() for one in candidates)
        said = ros.inside(
            "cdr_bench.py", folder, name, octets, str(arguments.rounds), sysconfig.get_path("purelib"),
            prefix=arguments.prefix,
        )  # fmt: skip
        is_missed |= _print_row(name, json.loads(said))
    return int(is_missed)


def messages(schema: Schema, names: tuple[str, ...]) -> Iterator[tuple[str, list[bytes]]]:
    """Messages of which one will do for each name; each of the real ones alone."""
    codec_module = importlib.import_module("captain_messages")
    real = [(case.name, case.octets) for case in cases()]
    for name in names:
        message = codec_module.find(name)
        found = [octets for edition, octets in real if edition == name]
        values = Values(schema, schema.messages[name].pdu, seed=1, knows_more=False, is_long=False)
        made = [message.encode(values.value()) for _ in range(MADE)]
        whole = [one for one in made if len(one) < LONGEST and not message.to_cdr(one)[1]]
        yield from ((name, [octets]) for octets in found)
        if not found:
            yield name, sorted(whole, key=len, reverse=True)[:TRIED]


def _print_row(name: str, said: dict[str, Any]) -> bool:
    """Whether the goal is missed. Why a peer has no figures is told on stderr."""
    there, back = said["ours_to"], said["ours_from"]
    cells, ratio = "", 0.0
    for peer in PEERS:
        if f"{peer}_to" not in said:
            cells += f"{'-':>50}"
            continue
        theirs = said[f"{peer}_to"], said[f"{peer}_from"]
        both = theirs[0] / there, theirs[1] / back
        cells += f"{theirs[0] / 1e3:>14.0f} us{theirs[1] / 1e3:>9.0f} us{both[0]:>12.0f} x{both[1]:>9.0f} x"
        if peer == "asn1tools":
            ratio = sum(theirs) / (there + back)
    verdict = "" if not ratio else "reached" if ratio >= GOAL else "MISSED"
    print(
        f"{name:24}{said['octets']:>7}{said['cdr']:>6.0f}{there:>8.0f} ns{back:>8.0f} ns{cells}  {verdict}", flush=True
    )
    for peer, why in said["without"].items():
        print(f"{name}: no {PEERS[peer]}: {why}", file=sys.stderr)
    return verdict == "MISSED"


if __name__ == "__main__":
    sys.exit(main())
