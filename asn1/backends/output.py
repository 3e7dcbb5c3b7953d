"""Writer of generated directories; touches only changed files, to keep rebuilds short."""

import shutil
import tempfile
from abc import ABC, abstractmethod
from collections.abc import Callable
from pathlib import Path

from asn1.backends.backend import BackendError, Job, OwnOption, Progress

MANIFEST = ".captain-asn1"  # in each output directory: the format of the generated files, then their names
FORM = "form: "


class NotOursError(BackendError):
    """The directory contains files of another program, or of another format."""


def write(folder: Path, fill: Callable[[Path], None], form: str) -> int:
    """Update a folder to what `fill` writes to an empty directory. Returns the number of changed files.

    Removes files that an earlier call wrote and this one does not. Other files stay.
    Raises NotOursError for a directory with another format, or one that is not empty and was not written here.
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


class FileBackend(ABC):
    """A format whose files `fill` writes to an empty folder. Its attributes are those of Backend."""

    name: str
    summary: str
    next_step: str
    options: tuple[OwnOption, ...] = ()

    def default_folder(self) -> str:
        return f"build/{self.name}"

    def steps(self, job: Job) -> int:
        return 1

    def parts(self, folder: Path) -> set[str]:
        return set()

    @abstractmethod
    def fill(self, job: Job, folder: Path, progress: Progress) -> None:
        """Write the files of the format to an empty folder."""

    def write(self, job: Job, folder: Path, progress: Progress) -> int:
        """Write the format, like Backend.write. Raises NotOursError, OSError, and the errors of `fill`."""
        return write(folder, lambda made: self.fill(job, made, progress), self.name)


def _ours(folder: Path, form: str) -> set[Path]:
    if not folder.exists():
        return set()
    if not folder.is_dir():
        raise NotOursError(f"{folder}: not a directory; choose a directory")
    manifest = folder / MANIFEST
    if manifest.exists():
        lines = manifest.read_text(encoding="utf-8").splitlines()
        there = lines.pop(0).removeprefix(FORM) if lines and lines[0].startswith(FORM) else form
        if there != form:
            raise NotOursError(
                f"{folder}: contains the format {there}, not {form}; choose another directory or delete it"
            )
        return set(map(Path, lines))
    if any(folder.iterdir()):
        raise NotOursError(f"{folder}: not empty and not written by captain-asn1; choose an empty or a new directory")
    return set()


def _remove_empty(top: Path, folder: Path) -> None:
    """Remove a folder and its parents below `top`, if they are empty."""
    while folder != top and folder.is_dir() and not any(folder.iterdir()):
        folder.rmdir()
        folder = folder.parent


def _replace(made: Path, target: Path) -> bool:
    """Move a file to its place. Returns False, and leaves the old file, if the octets are the same."""
    if target.is_file() and target.read_bytes() == made.read_bytes():
        return False
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.move(made, target)
    return True
