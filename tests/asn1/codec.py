"""The codec module of `make codec`; tests fail if it is missing."""

import importlib
import json
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "build" / "codec" / "python"


def _load() -> Any:
    if str(FOLDER) not in sys.path:
        sys.path.append(str(FOLDER))
    try:
        return importlib.import_module("captain_messages")
    except ImportError as error:
        raise ImportError("captain_messages is not built: make codec") from error


captain_messages = _load()

# Real messages, by edition; sources stand in the file.
_EDITIONS = {
    "CAM EN 302 637-2 v1.4.1": "cam-1.4.1",
    "CAM TS 103 900 v2.3.1": "cam-2.3.1",
    "DENM EN 302 637-3 v1.3.1": "denm-1.3.1",
    "DENM TS 103 831 v2.3.1": "denm-2.3.1",
    "MAPEM TS 103 301 v2.1.1": "mapem-2.1.1",
    "SPATEM TS 103 301 v2.1.1": "spatem-2.1.1",
    "IVIM TS 103 301 v2.1.1": "ivim-2.1.1",
    "CPM TR 103 562 v2.1.1": "cpm-tr-2.1.1",
    "VAM TS 103 300-3 v2.3.1": "vam-2.3.1",
}
REAL = [
    (_EDITIONS[vector["module"]], bytes.fromhex(vector["hex"]))
    for vector in json.loads((ROOT / "firmware" / "vectors.json").read_text())
]
IDS = [f"{name}-{len(octets)}-octets" for name, octets in REAL]


def real(name: str, count: int) -> bytes:
    """The real message of this edition and number of octets."""
    return next(octets for edition, octets in REAL if edition == name and len(octets) == count)


CAM = captain_messages.find("cam-1.4.1")
CAM_OCTETS = real("cam-1.4.1", 46)
