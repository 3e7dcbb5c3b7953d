"""Sizes of the card and times of its build, beside their goals."""

import json
import tarfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from image.card.build import CardBuild
from image.description import Description
from image.program.contents import layers

COLD_S, WARM_S = 20 * 60, 5 * 60  # goals: with nothing kept but fetched packages; after a change of our sources


class Figure(NamedTuple):
    """Measured figure. most: its goal, the largest value; 0: without a goal."""

    what: str
    value: float
    unit: str
    most: float = 0.0
    note: str = ""

    @property
    def is_ok(self) -> bool:
        return not self.most or self.value <= self.most

    def __str__(self) -> str:
        goal = f"goal: at most {self.most:g}" if self.most else ""
        head = f"{'ok' if self.is_ok else 'MISSED':6}  {self.what:12} {self.value:8.1f} {self.unit:3}"
        return f"{head} {goal:20} {self.note}".rstrip()


def sizes(described: Description, folder: Path, card: CardBuild) -> Iterator[Figure]:
    """Yield the sizes of a card and of the parts in its build folder."""
    room_mib = described.disk.partition("root-a").size_mib
    stored_mb = card.image.stat().st_blocks * 512 / 1e6
    yield Figure("card", _mb(card.image), "MB", note=f"{stored_mb:.0f} MB without its holes")
    with tarfile.open(folder / "parts/root.tar") as tar:
        members = tar.getmembers()
    octets = sum(-(-member.size // 4096) * 4096 for member in members)
    files = sum(member.isreg() for member in members)
    yield Figure(
        "root", octets / 1e6, "MB", room_mib * 1.048576 * 0.9, f"{files} files; a tenth of the slot stays free"
    )
    yield Figure("captain", layers.octets(folder / "program/captain") / 1e6, "MB", layers.MOST_MB)
    yield Figure("early boot", _mb(folder / "early/initrd"), "MB")
    yield Figure("update", _mb(card.bundle), "MB")
    packages = len(json.loads(card.packages.read_text()))
    yield Figure("packages", packages, "", note="including dependencies, kernel and firmware")


def times(took: Mapping[str, float], in_all_s: float) -> Iterator[Figure]:
    """Yield the times of the steps; a build that made the userland is a cold one."""
    for name, took_s in took.items():
        yield Figure(name, took_s, "s")
    yield Figure("in all", in_all_s, "s", COLD_S if "userland" in took else WARM_S)


def _mb(path: Path) -> float:
    return path.stat().st_size / 1e6
