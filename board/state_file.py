"""Files of the station that outlive a loss of power: each is the old one or the new one, never a part.

A rename alone is not enough: the name may be on the card before the content, and after the cut the file is empty. So
the content is waited for, then the name is given, then the folder is waited for.
"""

import contextlib
import errno
import os
from pathlib import Path

from board.errors import StorageError

NEW = ".new"


class Refusals:
    """Writes of state that the machine has refused: how many, and what was said of the last one.

    hint  what to do; empty once it has taken one again.
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


# Of this process, as its memory is.
REFUSALS = Refusals()


def keep(path: Path, octets: bytes, mode: int = 0o644) -> None:
    """Replace a file; once this returns, it outlives a cut. Waits for the card: some 10 ms.

    Raises StorageError, counted, where nothing can be written: the file is the old one then, or the new one.
    """
    new = path.with_name(path.name + NEW)
    try:
        _write(new, octets, mode)
        os.rename(new, path)
        settle(path.parent)
    except OSError as error:
        with contextlib.suppress(OSError):
            os.unlink(new)  # a part of a file would take the room that is lacking
        raise REFUSALS.note(refused(path, "written", error)) from error
    REFUSALS.over()


def forget(path: Path) -> None:
    """Remove a file for good; one that is not there is forgotten. Raises StorageError, counted."""
    try:
        os.unlink(path)
        settle(path.parent)
    except FileNotFoundError:
        return
    except OSError as error:
        raise REFUSALS.note(refused(path, "removed", error)) from error


def read(path: Path, most: int) -> bytes | None:
    """The content; None: there is none. Raises StorageError for more octets than that, and for what cannot be read."""
    try:
        with open(path, "rb") as file:
            octets = file.read(most + 1)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise refused(path, "read", error) from error
    if len(octets) > most:
        raise StorageError(f"{path}: longer than {most} octets", "it is not what the station wrote: remove it")
    return octets


def settle(folder: Path) -> None:
    """The names in a folder outlive a cut once this returns. Raises OSError."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def refused(path: Path, what: str, error: OSError) -> StorageError:
    """What the machine has refused, and what to do. what: written, removed, read."""
    hint = HINTS.get(error.errno or 0, "look at the card, and at what the kernel says of it: journalctl -k")
    return StorageError(f"{path}: cannot be {what}: {error.strerror}", hint.format(folder=path.parent))


def _write(path: Path, octets: bytes, mode: int) -> None:
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC | os.O_NOFOLLOW, mode)
    try:
        os.fchmod(descriptor, mode)  # a cut may have left one of another mode
        view = memoryview(octets)
        while view:
            view = view[os.write(descriptor, view) :]
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


HINTS = {
    errno.ENOSPC: "there is no room in {folder}: remove recordings, or take a larger card",
    errno.EDQUOT: "there is no room in {folder}: remove recordings, or take a larger card",
    errno.EROFS: "{folder} takes no writes: a card that is worn out does so; take another one",
    errno.EIO: "{folder}: the card fails: take another one",
    errno.ENOENT: "make the folder {folder}, for the station's user",
    errno.ENOTDIR: "make the folder {folder}, for the station's user",
    errno.EACCES: "give {folder} to the station's user",
    errno.EPERM: "give {folder} to the station's user",
}
