"""Temporary folder of a process; the next process removes those of killed ones."""

import contextlib
import fcntl
import os
import shutil
import tempfile
import weakref
from pathlib import Path

from board.runtime.address import MOST_SOCKET_PATH
from board.runtime.errors import ConfigurationError
from board.runtime.toml import show

# The owner of the folder holds a lock on this file. The kernel releases it when the process ends, even if killed.
LOCK = ".lock"

# Removing 200 small files from a busy disk takes a second and more; from memory, 5 ms.
MEMORY = "/dev/shm"

ROOM = len("/") + 8 + len("/uevents")  # octets after parent and prefix: mkdtemp adds 8; then the longest socket's name


class Scratch:
    """New temporary folder: in TMPDIR if set, else in memory, else in the system's temporary folder.

    close(), or the end of the process, removes it. Folders with the same prefix that killed processes left are
    removed first.

    prefix  beginning of its name.

    Raises OSError if it cannot be made, ConfigurationError if its path is too long for the sockets in it.
    """

    def __init__(self, prefix: str) -> None:
        _check_room(prefix)
        _sweep(prefix)
        self.path, lock = _held(prefix)
        self._remove = weakref.finalize(self, _remove, self.path, lock)

    def close(self) -> None:
        """Remove the folder; idempotent."""
        self._remove()


def _parent() -> str:
    """Return the folder that holds all temporary folders."""
    is_chosen = "TMPDIR" in os.environ or not os.access(MEMORY, os.W_OK | os.X_OK)
    return tempfile.gettempdir() if is_chosen else MEMORY


def _check_room(prefix: str) -> None:
    most = MOST_SOCKET_PATH - ROOM - len(prefix)
    if (octets := len(os.fsencode(_parent()))) > most:
        raise ConfigurationError(f"TMPDIR too long: {octets} octets: {show(_parent())}", f"use at most {most}")


def _held(prefix: str) -> tuple[Path, int]:
    """Make a folder; return it with the descriptor of its locked file."""
    while True:
        path = Path(tempfile.mkdtemp(prefix=prefix, dir=_parent()))
        lock = os.open(path / LOCK, os.O_CREAT | os.O_EXCL | os.O_RDWR | os.O_CLOEXEC, 0o600)
        fcntl.flock(lock, fcntl.LOCK_EX)
        if os.fstat(lock).st_nlink:
            return path, lock
        os.close(lock)  # another process removed it before it was locked


def _remove(path: Path, lock: int) -> None:
    shutil.rmtree(path, ignore_errors=True)
    os.close(lock)


def _sweep(prefix: str) -> None:
    """Remove folders whose process has ended; folders of other users or without a lock file remain."""
    for lock in Path(_parent()).glob(f"{prefix}*/{LOCK}"):
        with contextlib.suppress(OSError):  # belongs to another user, is locked, or was just removed
            descriptor = os.open(lock, os.O_RDWR | os.O_CLOEXEC | os.O_NOFOLLOW)
            try:
                if os.fstat(descriptor).st_uid == os.getuid():
                    fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    shutil.rmtree(lock.parent, ignore_errors=True)
            finally:
                os.close(descriptor)
