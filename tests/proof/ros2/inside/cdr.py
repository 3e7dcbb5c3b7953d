"""Made values of one message through to_cdr and from_cdr: a JSON object on stdout.

    cdr.py FOLDER EDITION PROFILE COUNT

FOLDER holds captain_messages. Counted: CDR as rosbags writes it; UPER that comes back; UPER that comes back with the
original, because something has no place in the ROS message, which has to be said. What lies between the numbers of the
CDR that comes back is not what was written there.
"""

import json
import sys
from collections import Counter
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[4]
sys.path[:0] = [sys.argv[1], str(ROOT)]

import captain_messages

from asn1.backends.ros2 import profiles
from asn1.model.text import load_schema
from tests.asn1.backends.ros2 import cdr_padding
from tests.asn1.backends.ros2.cdr_reference import Reference
from tests.asn1.values import Values

SEEDS = {False: 1, True: 2}


def main(edition: str, profile: str, count: int) -> dict[str, Any]:
    schema = load_schema()
    message = captain_messages.find(edition)
    [package] = profiles.packages(schema, [schema.messages[edition]], profile)
    reference = Reference(schema, package)
    counts: Counter[str] = Counter()
    trouble = ""
    for is_newer in (False, True):
        values = Values(schema, schema.messages[edition].pdu, SEEDS[is_newer], knows_more=is_newer)
        for _ in range(count):
            octets = message.encode(values.value())
            cdr, left_out = message.to_cdr(octets, profile)
            if not is_newer:
                is_same = cdr == reference.cdr(edition, message.decode(octets))
                counts["same"] += is_same
                trouble = trouble or ("" if is_same else f"rosbags writes {octets.hex()} in another way")
            filled = cdr_padding.filled(package, package.top(edition).name, cdr)
            how = _back(message, octets, filled, left_out, profile)
            counts[f"{'newer_' if is_newer else ''}{how}"] += 1
            if how == "lost":
                trouble = trouble or f"{octets.hex()} does not come back"
    names = ("same", "back", "original", "newer_back", "newer_original")
    return {"values": count, "trouble": trouble, **{name: counts[name] for name in names}}


def _back(message: Any, octets: bytes, cdr: bytes, left_out: tuple[Any, ...], profile: str) -> str:
    try:
        back = message.from_cdr(cdr, profile)
    except ValueError:
        back = None
    if back == octets:
        return "back"
    is_kept = bool(left_out) and message.from_cdr(cdr, profile, original=octets) == octets
    return "original" if is_kept else "lost"


if __name__ == "__main__":
    print(json.dumps(main(sys.argv[2], sys.argv[3], int(sys.argv[4]))))
