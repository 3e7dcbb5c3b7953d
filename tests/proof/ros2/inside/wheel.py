"""The messages of the committed corpus to CDR and back, by the captain_messages that is installed: JSON on stdout.

    wheel.py EDITION...

By a clean Python, which has nothing of this project: 3.10 or later.
"""

import json
import platform
import sys
from pathlib import Path

import captain_messages

CORPUS = Path(__file__).resolve().parents[3] / "asn1" / "corpus"
PROFILES = ("etsi_its", "v2x_msgs")


def main(editions: list[str]) -> dict[str, object]:
    counts = {"messages": 0, "same": 0}
    for edition in editions:
        message = captain_messages.find(edition)
        for line in (CORPUS / f"{edition}.hex").read_text().split():
            try:
                octets = message.encode(message.decode(bytes.fromhex(line)))
            except ValueError:
                continue  # half of the corpus is no message
            counts["messages"] += 1
            counts["same"] += all(_comes_back(message, octets, profile) for profile in PROFILES)
    return {"python": platform.python_version(), **counts}


def _comes_back(message: captain_messages.Message, octets: bytes, profile: str) -> bool:
    cdr, left_out = message.to_cdr(octets, profile)
    return bool(message.from_cdr(cdr, profile, original=octets if left_out else None) == octets)


if __name__ == "__main__":
    print(json.dumps(main(sys.argv[1:])))
