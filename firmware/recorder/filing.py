"""A file that is written in whole blocks: a disk that is full or gone costs frames, which are counted, and no more."""

import os
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from firmware.recorder.hearing import say
from firmware.recorder.scribe import Scribe
from firmware.recorder.told import Told

LARGE = 1 << 16  # octets that are written at once, whatever the time
STORE_S = 0.2  # whoever reads along sees them
SYNC_S = 0.5  # a cut of power costs this, what waits for STORE_S, and what is on its way here: a second
AGAIN_S = 1.0  # after it could not be written


class Segment:
    """A file, opened to go on at its end. What is written waits for store(), which stores all of it or nothing."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC, 0o644)
        self._inode = os.fstat(self._descriptor).st_ino
        self._stored = os.fstat(self._descriptor).st_size
        self._waiting = bytearray()
        self._is_synced = True

    def write(self, octets: bytes) -> None:
        self._waiting += octets

    @property
    def waiting(self) -> int:
        return len(self._waiting)

    def store(self) -> None:
        """Raises OSError, having cut off what was written of it."""
        try:
            if not self._waiting:
                return
            view = memoryview(self._waiting)
            while view:
                view = view[os.write(self._descriptor, view) :]
            view.release()
        except OSError:
            os.ftruncate(self._descriptor, self._stored)
            raise
        self._stored += len(self._waiting)
        self._waiting = bytearray()
        self._is_synced = False

    def sync(self) -> None:
        """So that it outlives the power. Raises OSError, also where the file is no longer in its folder."""
        if os.stat(self.path).st_ino != self._inode:
            raise FileNotFoundError(2, "another file has its name")
        if not self._is_synced:
            os.fdatasync(self._descriptor)
            self._is_synced = True

    def close(self) -> None:
        """One that holds nothing is removed: a full disk makes a file and takes nothing."""
        if not self._stored:
            with suppress(OSError):
                self.path.unlink()
        os.close(self._descriptor)


class Filing:
    """Writes frames into segments.

    open_    gives the next one; raises OSError.
    closed   is told of each that nothing more is written to, and how many frames it has.
    trouble  why nothing is written now; empty when it is.
    """

    def __init__(
        self,
        scribe: Scribe,
        open_: Callable[[], Segment],
        closed: Callable[[Path, int], None] = lambda path, frames: None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.scribe = scribe
        self.trouble = ""
        self.troubles = 0
        self._open = open_
        self._closed = closed
        self._clock = clock
        self._segment: Segment | None = None
        self._waiting: Counter[str] = Counter()  # frames by interface that are not stored
        self._stored: Counter[str] = Counter()  # that the file takes along when it goes
        self._stored_at = self._synced_at = self._tried_at = -AGAIN_S

    @property
    def path(self) -> Path | None:
        return self._segment.path if self._segment else None

    @property
    def in_file(self) -> Counter[str]:
        """Frames by interface that are in the file or wait for it."""
        return self._stored + self._waiting

    def add(self, told: Told) -> None:
        self.scribe.add(told)
        if self._segment is not None:
            self._waiting[told.interface] += 1
            if self._segment.waiting >= LARGE:
                self.store()

    def idle(self) -> None:
        """A few times a second: writes what waits, and tries again what did not work."""
        now = self._clock()
        if self._segment is None and now >= self._tried_at + AGAIN_S:
            self._tried_at = now
            self.begin()
        if now >= self._stored_at + STORE_S:
            self.store()
        if now >= self._synced_at + SYNC_S:
            self._synced_at = now
            self._do(lambda segment: segment.sync())

    def begin(self) -> None:
        """Go on in the next segment."""
        self.end()
        try:
            self._segment = self._open()
        except OSError as error:
            self._failed(error)
            return
        self.scribe.begin(self._segment)
        self.store()
        if self._segment is not None and self.trouble:
            say(f"recording goes on: {self._segment.path}")
            self.trouble = ""

    def store(self) -> None:
        self._stored_at = self._clock()
        if self._do(lambda segment: segment.store()):
            self._stored += self._waiting
            self._waiting.clear()

    def end(self) -> None:
        """The segment is whole, and nothing is written any more."""
        if self._segment is not None:
            self.scribe.end()
            self.store()
        if self._segment is not None:
            self._do(lambda segment: segment.sync())
        self._close()

    def _close(self) -> None:
        segment, self._segment = self._segment, None
        if segment is not None:
            segment.close()
            self._closed(segment.path, self._stored.total())
        self._stored.clear()

    def _do(self, what: Callable[[Segment], None]) -> bool:
        if self._segment is None:
            return False
        try:
            what(self._segment)
        except OSError as error:
            self._failed(error)
            return False
        return True

    def _failed(self, error: OSError) -> None:
        """What waits is lost; the next try comes later."""
        why = error.strerror or str(error)
        where = self._segment.path if self._segment else error.filename or "recording"
        if not self.trouble:
            say(f"{where}: {why.lower()}: frames are counted as lost until it can be written again")
        self.trouble = why
        self.troubles += 1
        self._tried_at = self._clock()
        self.scribe.abandon()
        self.scribe.unwrite(self._waiting)
        if not self._is_there():
            self.scribe.unwrite(self._stored)
        self._waiting.clear()
        self._close()

    def _is_there(self) -> bool:
        return self._segment is None or self._segment.path.exists()
