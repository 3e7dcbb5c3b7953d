"""The card once more from the same packages, in another folder, and what of it is not the same."""

import hashlib
import shutil
import tarfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from image import checksum
from image.build import Build
from image.description import Description

# What a build begins with, and what is the owner's: everything else is made again.
KEPT = ("archive", "native", "packages", "keys")
CARD = "card.img"
SHOWN = 20  # of what differs; a card that differs at all differs in few files


class Compared(NamedTuple):
    """A step's results, compared.

    files  how many there are. differing: paths. is_left_out: those are not in the card.
    """

    what: str
    files: int
    differing: list[str]
    is_left_out: bool = False

    def __str__(self) -> str:
        if not self.differing:
            return f"same    {self.what}: {self.files} files"
        shown = "".join(f"\n          {path}" for path in self.differing[:SHOWN])
        more = "" if len(self.differing) <= SHOWN else f"\n          and {len(self.differing) - SHOWN} more"
        left_out = ", left out of the card" if self.is_left_out else ""
        return f"DIFFER  {self.what}: {len(self.differing)} of {self.files} files{left_out}{shown}{more}"


def again(first: Path, description: Description) -> tuple[Path, dict[str, float]]:
    """A second build beside the first one's folder, but for its update, whose signature has a time and a salt in it.

    Returns its folder, the card in it as CARD, and seconds by step. Raises ImageError.
    """
    folder = first.with_name(f"{first.name}-twice")
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for name in KEPT:
        if (first / name).exists():
            (folder / name).symlink_to((first / name).resolve())
    made = Build(description, folder)
    made.assemble(made.parts(), folder / CARD)
    return folder, made.steps.took


def compared(first: Path, card: Path, second: Path) -> Iterator[Compared]:
    """Step by step, in the order that they are made in; the card itself last. card: the first one."""
    for name, files in (
        ("foreign", "captain/**/*"),
        ("messages", "*.so"),
        ("program", "captain/**/*"),
        ("early", "*"),
        ("parts", "boot/**/*"),
    ):
        yield _compared(f"{name}/{files}", _digests(first / name, files), _digests(second / name, files))
    userland, slot = (
        _compared(f"{tar}, its files", _members(first / tar), _members(second / tar))
        for tar in ("userland/root.tar", "parts/root.tar")
    )
    yield userland._replace(is_left_out=not slot.differing)  # the second is made of the first
    yield slot
    yield _compared("the card", {card.name: checksum.sha256(card)}, {card.name: checksum.sha256(second / CARD)})


def _compared(what: str, one: Mapping[str, str], other: Mapping[str, str]) -> Compared:
    names = sorted({*one, *other})
    return Compared(what, len(names), [name for name in names if one.get(name) != other.get(name)])


def _digests(folder: Path, pattern: str) -> dict[str, str]:
    paths = [path for path in folder.glob(pattern) if path.is_file() and not path.name.startswith(".")]
    return {path.relative_to(folder).as_posix(): checksum.sha256(path) for path in paths}


def _members(tar: Path) -> dict[str, str]:
    """With owner and mode, without dates: those of the card are all one."""
    found = {}
    with tarfile.open(tar) as archive:
        for member in archive:
            file = archive.extractfile(member) if member.isreg() else None
            digest = hashlib.file_digest(file, "sha256").hexdigest() if file else member.linkname  # type: ignore[arg-type]
            found[member.name] = f"{member.type!r} {member.mode:o} {member.uid} {member.gid} {digest}"
    return found
