"""A folder for as long as its process lives: what one that was killed has left is removed by the next."""

import contextlib
import fcntl
import os
import shutil
import tempfile
import weakref
from pathlib import Path

from board.address import MOST_SOCKET_PATH
from board.errors import ConfigurationError
from board.toml import show

# Whoever made the folder holds this file locked; the kernel lets go of it when that process ends, however it ends.
LOCK = ".lock"

# Removing two hundred small files from a disk that others write to takes a second and more; from memory, 5 ms.
MEMORY = "/dev/shm"

ROOM = len("/") + 8 + len("/uevents")  # octets beside parent and prefix: mkdtemp adds 8; the longest socket in it


class Scratch:
    """A new folder in memory, or where TMPDIR says, or in the system's folder for such.

    close(), or the end of the process, takes it away.

    prefix  of its name; what others of the same prefix have left is taken away before.
    Raises OSError where none can be made, ConfigurationError where no socket in it could be bound.
    """

    def __init__(self, prefix: str) -> None:
        _check_room(prefix)
        _sweep(prefix)
        self.path, lock = _held(prefix)
        self._remove = weakref.finalize(self, _remove, self.path, lock)

    def close(self) -> None:
        """Idempotent."""
        self._remove()


def _parent() -> str:
    """The folder of all of them."""
    is_chosen = "TMPDIR" in os.environ or not os.access(MEMORY, os.W_OK | os.X_OK)
    return tempfile.gettempdir() if is_chosen else MEMORY


def _check_room(prefix: str) -> None:
    most = MOST_SOCKET_PATH - ROOM - len(prefix)
    if (octets := len(os.fsencode(_parent()))) > most:
        raise ConfigurationError(f"TMPDIR too long: {octets} octets: {show(_parent())}", f"use at most {most}")


def _held(prefix: str) -> tuple[Path, int]:
    """A folder, and the descriptor of its locked file."""
    while True:
        path = Path(tempfile.mkdtemp(prefix=prefix, dir=_parent()))
        lock = os.open(path / LOCK, os.O_CREAT | os.O_EXCL | os.O_RDWR | os.O_CLOEXEC, 0o600)
        fcntl.flock(lock, fcntl.LOCK_EX)
        if os.fstat(lock).st_nlink:
            return path, lock
        os.close(lock)  # another process swept it away before it was locked


def _remove(path: Path, lock: int) -> None:
    shutil.rmtree(path, ignore_errors=True)
    os.close(lock)


def _sweep(prefix: str) -> None:
    """Remove folders whose process is gone; those of others, and what holds no lock file, stay."""
    for lock in Path(_parent()).glob(f"{prefix}*/{LOCK}"):
        with contextlib.suppress(OSError):  # of another user, locked, or just gone
            descriptor = os.open(lock, os.O_RDWR | os.O_CLOEXEC | os.O_NOFOLLOW)
            try:
                if os.fstat(descriptor).st_uid == os.getuid():
                    fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    shutil.rmtree(lock.parent, ignore_errors=True)
            finally:
                os.close(descriptor)
