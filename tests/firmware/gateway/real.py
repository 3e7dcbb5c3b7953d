"""Messages of real stations: those of firmware/vectors.json."""

import json
from pathlib import Path

ROWS = json.loads((Path(__file__).parents[3] / "firmware" / "vectors.json").read_bytes())


def real(kind: str, octets: int) -> bytes:
    [row] = [row for row in ROWS if row["type"] == kind and row["octets"] == octets]
    return bytes.fromhex(row["hex"])


CAM = real("cam", 160)
DENM = real("denm", 404)
MAPEM = real("mapem", 536)
SPATEM = real("spatem", 203)
IVIM = real("ivim", 73)
