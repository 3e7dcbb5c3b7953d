"""Build steps with cached results, kept until their inputs change."""

import fcntl
import hashlib
import shutil
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from image.errors import ImageError

STAMP = ".made-from"
LOCK = "lock"


class Steps:
    """Folder of results. took: seconds by step that was executed. Raises ImageError if the folder is not writable."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder.resolve()
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            self._lock = (self.folder / LOCK).open("w")
        except OSError as error:
            what = f"{self.folder}: cannot be used as build folder: {error.strerror}"
            raise ImageError(what, "name a folder that you may write to with --to") from error
        fcntl.flock(self._lock, fcntl.LOCK_EX)  # held until close(): a second build in the folder waits
        self.took: dict[str, float] = {}

    def close(self) -> None:
        self._lock.close()

    def made(
        self, name: str, inputs: Iterable[str | Path], make: Callable[[Path], object], forced: bool = False
    ) -> Path:
        """Return the folder of a step's result; execute the step if its inputs have changed.

        inputs  words and files that the result depends on.
        make    makes the result in an empty folder; after an exception, the step counts as not executed.
        """
        place = self.folder / name
        stamp = place / STAMP
        digest = _digest(inputs)
        if not forced and stamp.exists() and stamp.read_text() == digest:
            return place
        print(f"image: {name}", file=sys.stderr, flush=True)
        began = time.monotonic()
        shutil.rmtree(place, ignore_errors=True)
        place.mkdir(parents=True)
        make(place)
        stamp.write_text(digest)
        self.took[name] = time.monotonic() - began
        return place


@contextmanager
def at_rest(folder: Path) -> Iterator[None]:
    """Keep builds in a folder from running, so that it can be read. A folder without any build is not touched."""
    lock = folder / LOCK
    if not lock.exists():
        yield
        return
    with lock.open() as file:
        fcntl.flock(file, fcntl.LOCK_SH)
        yield


def key(step: Path) -> str:
    """Return the digest of a step's inputs, as an input of the next step."""
    return (step / STAMP).read_text()


def _digest(inputs: Iterable[str | Path]) -> str:
    total = hashlib.sha256()
    for each in inputs:
        octets = str(each.name).encode() + b"\0" + each.read_bytes() if isinstance(each, Path) else each.encode()
        total.update(hashlib.sha256(octets).digest())
    return total.hexdigest()
