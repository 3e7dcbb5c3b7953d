"""Captured frames of an independent station, addresses for tests, fields by tshark."""

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
INGOLSTADT = Position(487668616, 114320680)  # position of the station in captures/frames.json
HERE = Ego(its_ms=722_312_391_739, position=INGOLSTADT, is_known=True)
NOWHERE = Ego(its_ms=722_312_391_739, position=Position(), is_known=False)


def packet(name: str) -> bytes:
    """Return a captured frame without its Ethernet header."""
    return FRAMES[name][14:]


def ethernet(octets: bytes) -> bytes:
    """Return a broadcast Ethernet frame of the neighbour with a GeoNetworking packet."""
    return b"\xff" * 6 + NEIGHBOUR + b"\x89\x47" + octets


def tshark(frames: list[bytes], folder: Path) -> list[dict[str, str]]:
    """Return the GeoNetworking and BTP fields that tshark shows for each frame, by name; only leaves of the tree."""
    if shutil.which("tshark") is None:
        pytest.fail("tshark is missing: install the package tshark")
    capture = folder / "frames.pcap"
    capture.write_bytes(_pcap(frames))
    command = ["tshark", "-n", "-r", str(capture), "-T", "json", "--no-duplicate-keys"]
    shown = subprocess.run(command, capture_output=True, check=True, timeout=60).stdout
    return [_leaves(frame["_source"]["layers"]) for frame in json.loads(shown)]


def _pcap(frames: list[bytes]) -> bytes:
    """Return a pcap file with Ethernet frames, all at time 0."""
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
