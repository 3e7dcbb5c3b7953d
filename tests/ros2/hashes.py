"""RIHS01 of every type: ours, rosbags', rosidl's, and those of etsi_its_messages where it has the package."""

import json
from collections.abc import Iterable
from pathlib import Path

from asn1.ros2.model import RosPackage
from asn1.ros2.rihs import hash_of
from tests.ros2 import ros
from tests.ros2.packages import source
from tests.ros2.rows import Row

UPSTREAM_FILE = ros.ROOT / "tests" / "asn1" / "ros2" / "etsi_its_messages.json"
TABLE = ros.MADE / "hashes.md"

# Packages of etsi_its_messages that are not made here, and why.
NOT_MADE = {"etsi_its_mcm_uulm_msgs": "of a research project, whose module is not given"}


def compare(packages: Iterable[RosPackage]) -> list[Row]:
    """A row per package; type by type in build/ros2/hashes.md."""
    upstream = json.loads(UPSTREAM_FILE.read_text(encoding="utf-8"))["packages"]
    rows, lines = [], ["| type | hash | rosbags | rosidl | etsi_its_messages |", "| --- | --- | --- | --- | --- |"]
    for package in packages:
        ours = {name: hash_of(package, name) for name in package.messages}
        folder = source(package.profile) / package.name
        by_rosbags = _said("rosbags_hashes.py", folder)
        by_rosidl = _said("rosidl_hashes.py", folder)
        theirs = upstream.get(package.name, {})
        lines += [
            f"| {package.name}/{name} | {ours[name]} | {_word(ours[name], by_rosbags.get(name))} "
            f"| {_word(ours[name], by_rosidl.get(name))} | {_upstream(ours[name], theirs, name)} |"
            for name in ours
        ]
        rows += [
            _row(package.name, "rosbags", ours, by_rosbags),
            _row(package.name, "rosidl", ours, by_rosidl),
        ]
        if theirs:
            rows.append(_row(package.name, "etsi_its_messages", ours, {k: f"RIHS01_{v}" for k, v in theirs.items()}))
    for name, why in NOT_MADE.items():
        lines += [f"| {name}/{type_} | | | | not made: {why} |" for type_ in upstream[name]]
    TABLE.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return rows


def _said(script: str, folder: Path) -> dict[str, str]:
    found: dict[str, str] = json.loads(ros.inside(script, folder))
    return found


def _row(package: str, whose: str, ours: dict[str, str], theirs: dict[str, str]) -> Row:
    names = ours.keys() | theirs.keys()
    equal = [name for name in names if ours.get(name) == theirs.get(name)]
    other = sorted(names - set(equal))
    return Row(
        f"{package}, {whose}", f"{len(equal)} of {len(theirs)} equal", f"not: {', '.join(other)}" if other else ""
    )


def _word(ours: str, theirs: str | None) -> str:
    return "equal" if ours == theirs else "differs"


def _upstream(ours: str, theirs: dict[str, str], name: str) -> str:
    if not theirs:
        return "has no such package"
    return _word(ours, f"RIHS01_{theirs.get(name, '')}")
