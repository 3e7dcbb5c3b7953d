"""Decoding of a capture by tshark: depth and errors per frame."""

import subprocess
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from board.runtime.errors import StationError

# Fields that tshark prints per frame: BTP port, protocols, malformed protocol, other complaints.
FIELDS = ("btpb.dstport", "frame.protocols", "_ws.malformed", "_ws.expert.message")
BEACON = "beacon"


class Dissected(NamedTuple):
    """Counts of all frames to one BTP port.

    port       BTP port; 0 for frames without BTP header, such as beacons.
    decoded    frames decoded down to the last field of an ITS message.
    btp        frames decoded down to BTP only: tshark does not know the message.
    malformed  frames with a part that tshark cannot decode.
    """

    port: int
    frames: int
    decoded: int
    btp: int
    malformed: int


def dissect(path: Path) -> list[Dissected]:
    """Return the counts by BTP port. Raises StationError if tshark is missing or cannot read the file."""
    command = ["tshark", "-n", "-r", str(path), "-T", "fields", "-E", "occurrence=f"]
    for field in FIELDS:
        command += ["-e", field]
    try:
        answer = subprocess.run(command, check=True, capture_output=True, text=True)
    except FileNotFoundError as error:
        raise StationError("the program tshark is missing", "install the package tshark") from error
    except subprocess.CalledProcessError as error:
        raise StationError(f"tshark cannot read {path}: {error.stderr.strip()}") from error
    return _rows(answer.stdout.splitlines())


def _rows(lines: Iterable[str]) -> list[Dissected]:
    rows: dict[int, Dissected] = {}
    for line in lines:
        port, protocols, malformed, complaint = (line.split("\t") + [""] * len(FIELDS))[: len(FIELDS)]
        number = int(port) if port else 0
        is_decoded = protocols.endswith(":its") and not complaint
        is_malformed = bool(malformed) or "gnw" not in protocols
        one = Dissected(number, 1, int(is_decoded), int(bool(port) and not is_decoded), int(is_malformed))
        before = rows.get(number, Dissected(number, 0, 0, 0, 0))
        rows[number] = Dissected(number, *(a + b for a, b in zip(before[1:], one[1:], strict=True)))
    return [rows[port] for port in sorted(rows)]
