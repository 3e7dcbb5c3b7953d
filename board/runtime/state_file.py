"""State files that survive a power cut with old or new content.

A rename alone is not enough: if the name reaches the card before the content, the file is empty after the cut. So the
content is synced first, then renamed, then the folder is synced.
"""

import contextlib
import errno
import os
from pathlib import Path

from board.runtime.errors import StorageError

NEW = ".new"


class Refusals:
    """Failed writes of state.

    count  number of failures.
    last   last error.
    hint   remedy; empty after a successful write.
    """

    def __init__(self) -> None:
        self.count = 0
        self.last = ""
        self.hint = ""

    def note(self, error: StorageError) -> StorageError:
        self.count += 1
        self.last, self.hint = error.message, error.hint
        return error

    def over(self) -> None:
        self.hint = ""


# One per process, like its memory.
REFUSALS = Refusals()


def keep(path: Path, octets: bytes, mode: int = 0o644) -> None:
    """Replace a file so that it survives a power cut once this returns. Waits for the card: about 10 ms.

    Raises StorageError, and counts it, if the write fails; the file then has its old or its new content.
    """
    new = path.with_name(path.name + NEW)
    try:
        _write(new, octets, mode)
        os.rename(new, path)
        settle(path.parent)
    except OSError as error:
        with contextlib.suppress(OSError):
            os.unlink(new)  # a partial file would occupy room, which may be what is lacking
        raise REFUSALS.note(refused(path, "written", error)) from error
    REFUSALS.over()


def forget(path: Path) -> None:
    """Remove a file permanently; an absent file is ignored. Raises StorageError, and counts it, if that fails."""
    try:
        os.unlink(path)
        settle(path.parent)
    except FileNotFoundError:
        return
    except OSError as error:
        raise REFUSALS.note(refused(path, "removed", error)) from error


def read(path: Path, most: int) -> bytes | None:
    """Return the content; None if absent. Raises StorageError if it is unreadable or longer than `most` octets."""
    try:
        with open(path, "rb") as file:
            octets = file.read(most + 1)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise refused(path, "read", error) from error
    if len(octets) > most:
        raise StorageError(f"{path}: longer than {most} octets", "the station never writes such a long file: remove it")
    return octets


def settle(folder: Path) -> None:
    """Sync a folder, so that the names in it survive a power cut. Raises OSError if that fails."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def refused(path: Path, what: str, error: OSError) -> StorageError:
    """Return the StorageError for a failed operation, with its remedy. what: written, removed or read."""
    hint = HINTS.get(error.errno or 0, "check the card: journalctl -k")
    return StorageError(f"{path}: cannot be {what}: {error.strerror}", hint.format(folder=path.parent))


def _write(path: Path, octets: bytes, mode: int) -> None:
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC | os.O_NOFOLLOW, mode)
    try:
        os.fchmod(descriptor, mode)  # a file left by a power cut may have another mode
        view = memoryview(octets)
        while view:
            view = view[os.write(descriptor, view) :]
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


HINTS = {
    errno.ENOSPC: "no room in {folder}: remove recordings, or use a larger card",
    errno.EDQUOT: "no room in {folder}: remove recordings, or use a larger card",
    errno.EROFS: "{folder} takes no writes: the card may be worn out; use another one",
    errno.EIO: "{folder}: the card fails: use another one",
    errno.ENOENT: "make the folder {folder}, for the station's user",
    errno.ENOTDIR: "make the folder {folder}, for the station's user",
    errno.EACCES: "give {folder} to the station's user",
    errno.EPERM: "give {folder} to the station's user",
}
