"""Folder of a bundle during download and installation: one bundle, bounded size."""

import fcntl
import json
import os
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

from board.runtime import state_file
from board.runtime.errors import StationError, StorageError

FOLDER = Path("/data/update")
# Octets left free for the station's state and the journal, which stops at 32 MiB free (SystemKeepFree).
RESERVE = 40 << 20
# Most octets read from a small state file. A URL with a signature has some thousand octets, and may be stored twice.
KEPT = 1 << 16


class LockedError(StationError):
    """Another update holds the lock: it fetches, checks or installs."""


@contextmanager
def storing(path: Path, what: str = "written") -> Iterator[None]:
    """Convert an OSError of the card. Raises StorageError with its remedy."""
    try:
        yield
    except OSError as error:
        raise state_file.refused(path, what, error) from error


class Folder:
    """Folder of the update. Failed reads and writes raise StorageError.

    part    the unfinished download.
    bundle  the finished download.
    """

    def __init__(self, place: Path = FOLDER, reserve: int = RESERVE) -> None:
        self.place = place
        self._own = place / "fetched"  # a separate folder, because operator may put files of any name into `place`
        self.part = self._own / "bundle.part"
        self.bundle = self._own / "bundle.raucb"
        self._about = self._own / "bundle.json"
        self._last = place / "last.json"
        self._reserve = reserve

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Hold the lock of updates. Raises LockedError if another update holds it, StationError if it fails."""
        try:
            self._own.mkdir(mode=0o700, exist_ok=True)
            lock = os.open(self.place / "lock", os.O_RDONLY | os.O_CREAT | os.O_CLOEXEC, 0o644)
        except OSError as error:
            why = f"{self.place}: {error.strerror}"
            raise StationError(f"cannot prepare an update: {why}", "run it as operator or root of a box") from error
        try:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                raise LockedError(
                    "another update is running", "wait for it; captain update --status shows the result"
                ) from error
            yield
        finally:
            os.close(lock)

    def room(self) -> int:
        """Return the octets that a bundle may still occupy."""
        with storing(self.place, "read"):
            found = os.statvfs(self.place)
        return max(0, found.f_bavail * found.f_frsize - self._reserve)

    def need(self, size: int) -> None:
        """Check the free room. Raises StationError if `size` octets do not fit."""
        if (room := self.room()) < size:
            raise StationError(
                f"{self.place}: no room: {size / 1e6:.0f} MB needed, {room / 1e6:.0f} MB free",
                "remove recordings or other files from /data, or use a larger card",
            )

    def about(self) -> Mapping[str, object]:
        """Return what is stored about the part: url, tag, size."""
        return _read(self._about)

    def note(self, about: Mapping[str, object]) -> None:
        state_file.keep(self._about, json.dumps(dict(about)).encode())

    def clear(self) -> None:
        """Remove everything except the last result."""
        for path in (self.part, self.bundle, self._about):
            with storing(path, "removed"):
                path.unlink(missing_ok=True)

    def finish(self) -> Path:
        """Sync the complete part and rename it to the bundle; return its path."""
        with storing(self.part):
            with self.part.open("rb") as file:
                os.fsync(file.fileno())
            self.part.rename(self.bundle)
            self._about.unlink(missing_ok=True)
        return self.bundle

    def last(self) -> Mapping[str, object]:
        """Return the last update's result: time, source, version, slot, result. Empty: no update yet."""
        return _read(self._last)

    def note_result(self, source: str, version: str, slot: str, result: str) -> None:
        """Store the result of an update. A full card is ignored, because it is not a failure of the update.

        slot  slot that was to be written; empty: the update ended before.
        """
        told = {"time": round(time.time()), "source": source, "version": version, "slot": slot, "result": result}
        with suppress(StorageError):
            state_file.keep(self._last, json.dumps(told).encode())


def _read(path: Path) -> Mapping[str, object]:
    try:
        with path.open("rb") as file:
            found = json.loads(file.read(KEPT))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}
