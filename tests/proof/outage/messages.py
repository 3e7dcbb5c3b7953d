"""Messages of a vehicle: CAMs, some DENMs, seldom a burst."""

import json
import random
from pathlib import Path
from typing import NamedTuple

import firmware

CAM_HZ = 10.0  # the most, EN 302 637-2 clause 6.1.3
SIZE = 41  # octets of a CAM without its optional containers
HEADER = 6  # octets of an ITS PDU header

CAM, DENM, POI = b"v2x.cam.", b"v2x.denm.", b"v2x.poi."
NUMBERS = {CAM: 2, DENM: 1, POI: 3}
_VECTORS = json.loads((Path(firmware.__file__).parent / "vectors.json").read_text())
RECORDED = next(row["hex"] for row in _VECTORS if (row["type"], row["octets"]) == ("denm", 43))
# Profile orange sends a DENM only if it can be decoded: this is the rest of a recorded one.
ANY = b"\x55" * (SIZE - HEADER)
REST = {CAM: ANY, POI: ANY, DENM: bytes.fromhex(RECORDED)[HEADER:]}

DENM_S = 20.0  # on average between two
BURST_S = 600.0  # the same
BURST = 400  # a queue holds 256

# That a path has to work in a message's lifetime, so that it could have left. A full queue and a full window leave at
# 20 in a round trip, behind everything else.
NEED_S = {CAM: 0.5, DENM: 0.5, POI: 3.0}


class Sending(NamedTuple):
    """What is due: an envelope, so many times."""

    envelope: bytes
    count: int = 1


class Schedule:
    """What is due at each tick of a CAM."""

    def __init__(self, seed: int, burst_s: float = BURST_S, denm_s: float = DENM_S) -> None:
        self._chance = random.Random(f"messages {seed}")
        self._shares = {DENM: 1 / (denm_s * CAM_HZ), POI: 1 / (burst_s * CAM_HZ)}

    def due(self) -> list[Sending]:
        due = [Sending(CAM)]
        if self._chance.random() < self._shares[DENM]:
            due.append(Sending(DENM))
        if self._chance.random() < self._shares[POI]:
            due.append(Sending(POI, BURST))
        return due


def pdu(envelope: bytes, number: int) -> bytes:
    """About the size of a CAM, with a number of our own as its stationID."""
    return bytes((2, NUMBERS[envelope])) + number.to_bytes(4, "big") + REST[envelope]


def need_s(octets: bytes) -> float:
    """As NEED_S, of a PDU."""
    return next(NEED_S[envelope] for envelope, number in NUMBERS.items() if number == octets[1])


def number_of(octets: bytes) -> int:
    return int.from_bytes(octets[2:6], "big")
