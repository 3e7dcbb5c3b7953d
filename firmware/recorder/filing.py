"""Segments of a recording, written in whole blocks; counts frames lost to a full or absent disk."""

import os
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from firmware.recorder.hearing import say
from firmware.recorder.reported_frame import ReportedFrame
from firmware.recorder.scribe import Scribe

LARGE = 1 << 16  # buffered octets that are written at once, before STORE_S is over
STORE_S = 0.2  # longest delay until a reader of the growing file sees a frame
# A power failure loses up to one second: this interval, STORE_S, and the frames on their way to the recorder.
SYNC_S = 0.5
AGAIN_S = 1.0  # between attempts to open a file after an error


class Segment:
    """File opened for appending. write() only fills a buffer; store() writes the whole buffer or nothing."""

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
        """Write the buffer to the file. On an error, remove the part already written and raise OSError."""
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
        """Flush the file to the disk.

        Raises OSError on an error, and if the file was removed or replaced in its folder.
        """
        if os.stat(self.path).st_ino != self._inode:
            raise FileNotFoundError(2, "another file has its name")
        if not self._is_synced:
            os.fdatasync(self._descriptor)
            self._is_synced = True

    def close(self) -> None:
        """Close the file. Remove it if it is empty, as on a full disk, which creates files but accepts no data."""
        if not self._stored:
            with suppress(OSError):
                self.path.unlink()
        os.close(self._descriptor)


class Filing:
    """Writes frames into consecutive segments.

    open_    opens the next segment; may raise OSError.
    closed   called with the path of each completed segment and its number of frames.
    trouble  error that prevents writing; empty without one.
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
        self._waiting: Counter[str] = Counter()  # unwritten frames by interface
        # Written frames of the current segment by interface; they count as lost if the file is removed.
        self._stored: Counter[str] = Counter()
        self._stored_at = self._synced_at = self._tried_at = -AGAIN_S

    @property
    def path(self) -> Path | None:
        return self._segment.path if self._segment else None

    @property
    def in_file(self) -> Counter[str]:
        """Number of frames by interface in the current segment, including its buffer."""
        return self._stored + self._waiting

    def add(self, told: ReportedFrame) -> None:
        self.scribe.add(told)
        if self._segment is not None:
            self._waiting[told.interface] += 1
            if self._segment.waiting >= LARGE:
                self.store()

    def idle(self) -> None:
        """Write the buffer when it is due, and open a segment again after an error.

        The caller calls it a few times a second.
        """
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
        """Complete the current segment and begin the next one."""
        self.end()
        try:
            self._segment = self._open()
        except OSError as error:
            self._failed(error)
            return
        self.scribe.begin(self._segment)
        self.store()
        if self._segment is not None and self.trouble:
            say(f"recording continues: {self._segment.path}")
            self.trouble = ""

    def store(self) -> None:
        self._stored_at = self._clock()
        if self._do(lambda segment: segment.store()):
            self._stored += self._waiting
            self._waiting.clear()

    def end(self) -> None:
        """Complete the current segment, flush it to the disk and close it."""
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
        """Report an error and count the frames of the buffer as lost. idle() tries again after AGAIN_S."""
        why = error.strerror or str(error)
        where = self._segment.path if self._segment else error.filename or "recording"
        if not self.trouble:
            say(f"{where}: {why.lower()}; frames count as lost until it can be written again")
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
