"""UPER to CDR and back: made values of every message, octet for octet against rosbags, and back to the same UPER."""

import json
from pathlib import Path

from asn1.backends.ros2.model import RosPackage
from tests.proof.ros2 import codec, ros
from tests.proof.ros2.rows import Row

VALUES = 2000  # of each message, and as many of what a newer sender may write


def compare(packages: list[RosPackage]) -> list[Row]:
    """A row for each message."""
    folder = codec.made(packages)
    return [_row(package, edition, folder) for package in packages for edition in package.tops]


def _row(package: RosPackage, edition: str, folder: Path) -> Row:
    said = json.loads(ros.inside("cdr.py", folder, edition, package.profile, str(VALUES)))
    found = (
        f"{said['same']} of {said['values']} as rosbags writes them, {said['back']} back to the same UPER, "
        f"{said['original']} with what was kept beside; of a newer sender {said['newer_back']} and {said['newer_original']}"
    )
    return Row(f"{package.name}/{package.tops[edition]}", found, said["trouble"])
