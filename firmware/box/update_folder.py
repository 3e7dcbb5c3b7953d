"""Where a bundle lies while it is fetched and installed: one at a time, and no more than there is room for."""

import fcntl
import json
import os
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

from board import state_file
from board.errors import StationError, StorageError

FOLDER = Path("/data/update")
# Left free for the station's own state and for the journal, which come first: it stops at 32 MiB (SystemKeepFree).
RESERVE = 40 << 20  # octets
# Octets of a small file that is read back: an address that signs itself has some thousand, and is told twice.
KEPT = 1 << 16


class LockedError(StationError):
    """Another update is being had, looked at or installed."""


@contextmanager
def storing(path: Path, what: str = "written") -> Iterator[None]:
    """What the card refuses meanwhile is told. Raises StorageError."""
    try:
        yield
    except OSError as error:
        raise state_file.refused(path, what, error) from error


class Folder:
    """part: what is being fetched. bundle: what was fetched whole. What the card refuses is a StorageError."""

    def __init__(self, place: Path = FOLDER, reserve: int = RESERVE) -> None:
        self.place = place
        self._own = place / "fetched"  # the folder itself is operator's, for files of any name
        self.part = self._own / "bundle.part"
        self.bundle = self._own / "bundle.raucb"
        self._about = self._own / "bundle.json"
        self._last = place / "last.json"
        self._reserve = reserve

    @contextmanager
    def locked(self) -> Iterator[None]:
        """For as long as one update lasts. Raises LockedError where another one has it, and StationError."""
        try:
            self._own.mkdir(mode=0o700, exist_ok=True)
            lock = os.open(self.place / "lock", os.O_RDONLY | os.O_CREAT | os.O_CLOEXEC, 0o644)
        except OSError as error:
            why = f"{self.place}: {error.strerror}"
            raise StationError(
                f"no update can be prepared: {why}", "updates are for operator and root of a box"
            ) from error
        try:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                raise LockedError(
                    "another update is running", "wait for it; captain update --status tells how it has ended"
                ) from error
            yield
        finally:
            os.close(lock)

    def room(self) -> int:
        """Octets that a bundle may still take."""
        with storing(self.place, "read"):
            found = os.statvfs(self.place)
        return max(0, found.f_bavail * found.f_frsize - self._reserve)

    def need(self, size: int) -> None:
        """Raises StationError unless so many octets more have room."""
        if (room := self.room()) < size:
            raise StationError(
                f"{self.place} has room for {room / 1e6:.0f} MB, and {size / 1e6:.0f} MB are to come",
                "remove recordings or other files from /data, or use a larger card",
            )

    def about(self) -> Mapping[str, object]:
        """What is known of the part: url, tag, size."""
        return _read(self._about)

    def note(self, about: Mapping[str, object]) -> None:
        state_file.keep(self._about, json.dumps(dict(about)).encode())

    def clear(self) -> None:
        """Of everything but the last result."""
        for path in (self.part, self.bundle, self._about):
            with storing(path, "removed"):
                path.unlink(missing_ok=True)

    def finish(self) -> Path:
        """The part is all of it, and on the card."""
        with storing(self.part):
            with self.part.open("rb") as file:
                os.fsync(file.fileno())
            self.part.rename(self.bundle)
            self._about.unlink(missing_ok=True)
        return self.bundle

    def last(self) -> Mapping[str, object]:
        """How the last update ended: time, source, version, slot, result. Empty: there was none."""
        return _read(self._last)

    def tell(self, source: str, version: str, slot: str, result: str) -> None:
        """Keep how an update ended. That there is no room for it is no failure of the update.

        slot  that it goes into; empty: it did not come to that.
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
