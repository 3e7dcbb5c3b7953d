"""RIHS01 of every type: ours, rosbags', rosidl's, and those of etsi_its_messages where it has the package."""

import json
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from asn1.backends.ros2.model import RosPackage
from asn1.backends.ros2.rihs import hash_of
from tests.proof.ros2 import ros
from tests.proof.ros2.packages import SCHEMA, source
from tests.proof.ros2.rows import Row

UPSTREAM_FILE = ros.ROOT / "tests" / "asn1" / "backends" / "ros2" / "etsi_its_messages.json"
DOCUMENT = ros.ROOT / "asn1" / "backends" / "ros2" / "HASHES.md"
TABLE = ros.MADE / "hashes.md"

# Packages of etsi_its_messages that are not made here, and why.
NOT_MADE = {"etsi_its_mcm_uulm_msgs": "not made: a message of a research project, whose module is not given"}

INTRODUCTION = """\
# Types of equal hash

Two ROS 2 nodes talk where the hash (RIHS01) of their types is the same. Computed four times: by `rihs.py`; by rosbags; by
ROS's own generator (rosidl_generator_type_description of Jazzy); and, for the packages that etsi_its_messages 3.5.0 has, by
rosbags from its released definitions (`tests/asn1/backends/ros2/etsi_its_messages.json`). Written by

    make ros2 ARGS='--only hashes'

which fails where this document says something else. Profile `etsi_its`. Two packages are made there of other editions than
here, with the same fields in every type: VAM of TS 103 300-3 v2.2.1, here v2.1.1; CPM with TS 102 894-2 v2.1.1, of which
three shapes have other names (`profile_etsi_its.py`).

| package | edition | types | rosbags | rosidl | etsi_its_messages |
| --- | --- | --- | --- | --- | --- |
"""


class Compared(NamedTuple):
    """A package: name of a type to its hash, by whom. upstream: nothing where it has no such package."""

    package: RosPackage
    ours: Mapping[str, str]
    rosbags: Mapping[str, str]
    rosidl: Mapping[str, str]
    upstream: Mapping[str, str]


def compare(packages: list[RosPackage]) -> list[Row]:
    """Rows of each package; type by type in build/ros2/hashes.md, which is to be asn1/backends/ros2/HASHES.md."""
    upstream = json.loads(UPSTREAM_FILE.read_text(encoding="utf-8"))["packages"]
    found = [_compared(package, upstream) for package in packages]
    text = INTRODUCTION + "\n".join(_lines(found, upstream)) + "\n"
    TABLE.write_text(text, encoding="utf-8")
    rows = [row for one in found for row in _rows(one)]
    if sum(len(package.tops) for package in packages) == len(SCHEMA.messages) and packages[0].profile == "etsi_its":
        is_same = DOCUMENT.is_file() and DOCUMENT.read_text(encoding="utf-8") == text
        words = str(DOCUMENT.relative_to(ros.ROOT))
        rows.append(Row(words, "says the same", "" if is_same else f"cp {TABLE.relative_to(ros.ROOT)} {words}"))
    return rows


def _compared(package: RosPackage, upstream: Mapping[str, Mapping[str, str]]) -> Compared:
    folder = source(package.profile) / package.name
    return Compared(
        package,
        {name: hash_of(package, name) for name in package.messages},
        json.loads(ros.inside("rosbags_hashes.py", folder)),
        json.loads(ros.inside("rosidl_hashes.py", folder)),
        {name: f"RIHS01_{digits}" for name, digits in upstream.get(package.name, {}).items()},
    )


def _rows(one: Compared) -> Iterator[Row]:
    for whose, theirs in (("rosbags", one.rosbags), ("rosidl", one.rosidl), ("etsi_its_messages", one.upstream)):
        if theirs:
            other = sorted(name for name in one.ours.keys() | theirs.keys() if one.ours.get(name) != theirs.get(name))
            trouble = f"not: {', '.join(other)}" if other else ""
            yield Row(f"{one.package.name}, {whose}", f"{_equal(one.ours, theirs)} equal", trouble)


def _lines(found: list[Compared], upstream: Mapping[str, Mapping[str, str]]) -> Iterator[str]:
    """The packages, and each type of those that etsi_its_messages has."""
    for one in found:
        theirs = _equal(one.ours, one.upstream) if one.upstream else "has none"
        yield (
            f"| {one.package.name} | {', '.join(one.package.tops)} | {len(one.ours)} | {_equal(one.ours, one.rosbags)} "
            f"| {_equal(one.ours, one.rosidl)} | {theirs} |"
        )
    for name, why in NOT_MADE.items():
        yield f"| {name} | none | {len(upstream[name])} | | | {why} |"
    for one in found:
        if one.upstream:
            yield f"\n## {one.package.name}\n\n| type | RIHS01 | rosbags | rosidl | etsi_its_messages |"
            yield "| --- | --- | --- | --- | --- |"
            yield from (
                f"| {name} | {one.ours.get(name, '').removeprefix('RIHS01_')} | {_word(one.ours, one.rosbags, name)} "
                f"| {_word(one.ours, one.rosidl, name)} | {_word(one.ours, one.upstream, name)} |"
                for name in sorted(one.ours.keys() | one.upstream.keys())
            )
    for name, why in NOT_MADE.items():
        yield f"\n## {name}\n\n| type | RIHS01 there | here |\n| --- | --- | --- |"
        yield from (f"| {type_} | {digits} | {why} |" for type_, digits in sorted(upstream[name].items()))


def _equal(ours: Mapping[str, str], theirs: Mapping[str, str]) -> str:
    return f"{sum(ours.get(name) == value for name, value in theirs.items())} of {len(theirs)}"


def _word(ours: Mapping[str, str], theirs: Mapping[str, str], name: str) -> str:
    if name not in theirs:
        return "has no such type"
    return "equal" if ours.get(name) == theirs[name] else "differs" if name in ours else "not made"
