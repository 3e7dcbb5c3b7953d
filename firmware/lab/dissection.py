"""What tshark makes of a capture: how far each frame is decoded, and whether any is malformed."""

import subprocess
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from board.errors import StationError

# One line a frame: BTP port, protocols, what is malformed, what tshark complains of beside.
FIELDS = ("btpb.dstport", "frame.protocols", "_ws.malformed", "_ws.expert.message")
BEACON = "beacon"


class Dissected(NamedTuple):
    """All frames to one BTP port.

    port       0 for what has no BTP header: beacons.
    decoded    down to the last field of an ITS message.
    btp        down to BTP only: tshark knows no such message.
    malformed  anything in them that tshark cannot make sense of.
    """

    port: int
    frames: int
    decoded: int
    btp: int
    malformed: int


def dissect(path: Path) -> list[Dissected]:
    """Rows by BTP port. Raises StationError when tshark is not there or cannot read the file."""
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
