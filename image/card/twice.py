"""Builds the card a second time and reports differences."""

import hashlib
import shutil
import tarfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from image import checksum
from image.card.build import Build
from image.description import Description

# Folders that the second build shares: its inputs, and the owner's keys. It makes everything else again.
KEPT = ("archive", "native", "packages", "keys")
CARD = "card.img"
SHOWN = 20  # most differing files shown; few files differ if any do


class Compared(NamedTuple):
    """Comparison of a step's results.

    files        number of files.
    differing    paths of the files that differ.
    is_left_out  the differing files are not in the card.
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
    """Build again beside the first build's folder, without the update bundle, whose signature has a time and a salt.

    Returns its folder, which has the card as CARD, and seconds by step. Raises ImageError if a step fails.
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
    """Compare step by step, in the order of the build, and the card at last. card: image of the first build."""
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
    yield userland._replace(is_left_out=not slot.differing)  # the slot is made from the userland
    yield slot
    yield _compared("the card", {card.name: checksum.sha256(card)}, {card.name: checksum.sha256(second / CARD)})


def _compared(what: str, one: Mapping[str, str], other: Mapping[str, str]) -> Compared:
    names = sorted({*one, *other})
    return Compared(what, len(names), [name for name in names if one.get(name) != other.get(name)])


def _digests(folder: Path, pattern: str) -> dict[str, str]:
    paths = [path for path in folder.glob(pattern) if path.is_file() and not path.name.startswith(".")]
    return {path.relative_to(folder).as_posix(): checksum.sha256(path) for path in paths}


def _members(tar: Path) -> dict[str, str]:
    """Return type, mode, owner and digest by path; without dates, because all files of the card have the same."""
    found = {}
    with tarfile.open(tar) as archive:
        for member in archive:
            file = archive.extractfile(member) if member.isreg() else None
            digest = hashlib.file_digest(file, "sha256").hexdigest() if file else member.linkname  # type: ignore[arg-type]
            found[member.name] = f"{member.type!r} {member.mode:o} {member.uid} {member.gid} {digest}"
    return found
