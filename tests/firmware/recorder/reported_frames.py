"""Frames as a station tells them, made by hand."""

import io
import json
from pathlib import Path

from firmware.recorder.reported_frame import ReportedFrame, parse
from firmware.recordings import capture

NOW_NS = 1_795_182_426_461_613_000
FRAME = bytes.fromhex("ffffffffffff02000000000b8947") + bytes(40)


def message(
    sequence: int = 1, interface: str = "air", frame: bytes = FRAME, **more: object
) -> tuple[bytes, bytes, bytes]:
    """Of topic `frame.`"""
    said = {
        "sequence": sequence,
        "missed": 0,
        "interface": interface,
        "direction": "in",
        "when_ns": NOW_NS,
        "quality": {"state": "locked", "error_ns": 1200},
        "is_made_up": False,
        "type": "cam",
        "message_id": 2,
        "station_id": 1337,
        **more,
    }
    return b"frame.%s." % interface.encode(), json.dumps(said).encode(), frame


def told(sequence: int = 1, interface: str = "air", frame: bytes = FRAME, **more: object) -> ReportedFrame:
    found = parse(list(message(sequence, interface, frame, **more)))
    assert found is not None
    return found


def read(path: Path) -> list[capture.Frame]:
    octets = path.read_bytes()
    return list(capture.frames(octets[:4], io.BytesIO(octets[4:])))
