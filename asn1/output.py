"""Writing a generated directory: only what has changed is touched, so that whoever builds from it builds little."""

import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

MANIFEST = ".captain-asn1"  # names the files of the directory that are ours, behind a line with their form
FORM = "form: "


class NotOursError(ValueError):
    """The directory holds files of somebody else, or of another form."""


def write(folder: Path, fill: Callable[[Path], None], form: str) -> int:
    """Make folder hold what `fill` puts into an empty directory, and return how many files have changed.

    Files of an earlier time that are no longer made are removed; files that were never ours stay.
    Raises NotOursError for a directory that is not empty and was not written here, or with another form.
    """
    before = _ours(folder, form)
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder.parent, prefix=".captain-asn1-") as made:
        fill(Path(made))
        files = sorted(path.relative_to(made) for path in Path(made).rglob("*") if path.is_file())
        changed = sum(_replace(Path(made) / file, folder / file) for file in files)
    for stale in before - set(files):
        (folder / stale).unlink(missing_ok=True)
        _remove_empty(folder, (folder / stale).parent)
        changed += 1
    (folder / MANIFEST).write_text("".join(f"{line}\n" for line in (FORM + form, *files)), encoding="utf-8")
    return changed


def _ours(folder: Path, form: str) -> set[Path]:
    if not folder.exists():
        return set()
    if not folder.is_dir():
        raise NotOursError(f"{folder} is a file: give a directory")
    manifest = folder / MANIFEST
    if manifest.exists():
        lines = manifest.read_text(encoding="utf-8").splitlines()
        there = lines.pop(0).removeprefix(FORM) if lines and lines[0].startswith(FORM) else form
        if there != form:
            raise NotOursError(f"{folder} holds the form {there}, not {form}: give another directory or delete it")
        return set(map(Path, lines))
    if any(folder.iterdir()):
        raise NotOursError(f"{folder} is not empty and was not made by captain-asn1: give an empty or a new directory")
    return set()


def _remove_empty(top: Path, folder: Path) -> None:
    """What held nothing but a file that is gone, up to the directory itself."""
    while folder != top and folder.is_dir() and not any(folder.iterdir()):
        folder.rmdir()
        folder = folder.parent


def _replace(made: Path, target: Path) -> bool:
    """Put a file in its place; False where the same octets are there."""
    if target.is_file() and target.read_bytes() == made.read_bytes():
        return False
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.move(made, target)
    return True
