"""Frames of an independent station (captures/frames.json), stations to talk about, and tshark's opinion of a frame."""

import json
import shutil
import struct
import subprocess
from pathlib import Path

import pytest

from drivers.message import Ego, Position

FRAMES = {
    frame["name"]: bytes.fromhex(frame["hex"])
    for frame in json.loads((Path(__file__).parents[2] / "captures/frames.json").read_text())["frames"]
}
SIGNED = [name for name in FRAMES if "signed" in name]
UNSECURED = [name for name in FRAMES if name not in SIGNED]

OWN = bytes.fromhex("020000000001")
NEIGHBOUR = bytes.fromhex("02000000000a")
INGOLSTADT = Position(487668616, 114320680)  # where the captured frames were sent
HERE = Ego(its_ms=722_312_391_739, position=INGOLSTADT, is_known=True)
NOWHERE = Ego(its_ms=722_312_391_739, position=Position(), is_known=False)


def packet(name: str) -> bytes:
    """A captured frame without its Ethernet header."""
    return FRAMES[name][14:]


def ethernet(octets: bytes) -> bytes:
    """A GeoNetworking packet as a broadcast frame of the neighbour."""
    return b"\xff" * 6 + NEIGHBOUR + b"\x89\x47" + octets


def tshark(frames: list[bytes], folder: Path) -> list[dict[str, str]]:
    """The GeoNetworking and BTP fields of each frame by name, as tshark shows them; leaves of the tree only."""
    if shutil.which("tshark") is None:
        pytest.fail("tshark is missing: install the package tshark")
    capture = folder / "frames.pcap"
    capture.write_bytes(_pcap(frames))
    command = ["tshark", "-n", "-r", str(capture), "-T", "json", "--no-duplicate-keys"]
    shown = subprocess.run(command, capture_output=True, check=True, timeout=60).stdout
    return [_leaves(frame["_source"]["layers"]) for frame in json.loads(shown)]


def _pcap(frames: list[bytes]) -> bytes:
    """The classic capture file, link type Ethernet, all at time 0."""
    records = [struct.pack("<IIII", 0, 0, len(frame), len(frame)) + frame for frame in frames]
    return struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1) + b"".join(records)


def _leaves(tree: dict[str, object]) -> dict[str, str]:
    found: dict[str, str] = {}
    for name, value in tree.items():
        if isinstance(value, dict):
            found |= _leaves(value)
        elif isinstance(value, list):
            for one in value:
                found |= _leaves(one) if isinstance(one, dict) else {}
        elif name.startswith(("geonw.", "btpa.", "btpb.", "_ws.")):
            found[name] = str(value)
    return found
