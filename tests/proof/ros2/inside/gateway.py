"""A gateway between a played station and a real node: every way, and everything bad that may come by either.

    gateway.py PORTS MESSAGES [OTHER]

PORTS: JSON, names of the endpoint's ports. MESSAGES: a JSON file, handler -> octets in hexadecimal. OTHER: a prefix with
another definition of CAM. Prints JSON: [what, what was found, trouble] of each.
"""

import json
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[4]
sys.path.append(str(ROOT))

import rclpy

from tests.proof.ros2.inside import gateway_live, gateway_ways, gateway_wrong
from tests.proof.ros2.inside.gateway_bench import Bench, WrongError

WAYS, LIVE, WRONG = gateway_ways, gateway_live, gateway_wrong
STEPS = (
    WAYS.connect, WAYS.receive, WAYS.metadata, WAYS.metadata_alone, WAYS.transmit, WAYS.left_out,
    LIVE.introspection, LIVE.parameters, LIVE.live, LIVE.rate, LIVE.requests, LIVE.services, LIVE.own,
    WRONG.out_of_range, WRONG.foreign, WRONG.header, WRONG.other_type, WRONG.other_hash, WRONG.undecodable, WRONG.rubbish,
    WRONG.gone_and_back, WAYS.receive, WAYS.transmit,
)  # fmt: skip


def main(ports: dict[str, int], messages: dict[str, bytes], other: str) -> None:
    rclpy.init()
    test = Bench(ports, messages, other)
    rows = []
    for step in STEPS:
        if step is WRONG.other_hash and not other:
            continue
        if step is not WAYS.connect:
            test.said.clear()
        try:
            found, trouble = step(test), ""
        except WrongError as wrong:
            found, trouble = "", str(wrong)
        rows.append([step.__name__.replace("_", " "), found, trouble])
        print(rows[-1], file=sys.stderr, flush=True)
    print(json.dumps(rows))


if __name__ == "__main__":
    main(
        json.loads(sys.argv[1]),
        {name: bytes.fromhex(octets) for name, octets in json.loads(Path(sys.argv[2]).read_text()).items()},
        sys.argv[3] if len(sys.argv) > 3 else "",
    )
