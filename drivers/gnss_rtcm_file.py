"""Corrections from a file that may grow, or from a pipe."""

import contextlib
import errno
import os

from drivers.contract import Host
from drivers.gnss_rtcm import BATCH, Attempts, Frames, Take

# A file is replayed at some 4000 octets a second, the rate of a line of 38,400 baud: RTCM for four systems has a
# quarter of it, so that one that grows is caught up with.
PERIOD_S = 0.25


class FileCorrections:
    """Replays a file and then waits for what is appended to it. One that is not there may come later."""

    def __init__(self, path: str, host: Host, take: Take) -> None:
        self._path = path
        self._frames = Frames(host, take)
        self._attempts = Attempts(path, host, self._frames)
        self._descriptor = -1
        self._at = 0  # octets that were read
        self._state = ""
        self._open()

    def close(self) -> None:
        self._attempts.close()
        self._close()
        self._state = "closed"

    def details(self) -> dict[str, object]:
        return {"source": self._path, "state": self._state, **self._frames.details()}

    def _open(self) -> None:
        self._attempts.begin()
        try:
            # Never waits: with O_NONBLOCK a pipe without a writer is empty.
            self._descriptor = os.open(self._path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
            if os.fstat(self._descriptor).st_size < self._at:
                self._at = 0  # it is another one, or was emptied
        except OSError as error:
            self._lose(error)
            return
        self._state = "open"
        self._attempts.wait(PERIOD_S, self._read)

    def _read(self) -> None:
        self._attempts.wait(PERIOD_S, self._read)
        try:
            octets = _read(self._descriptor, self._at)
        except OSError as error:
            self._lose(error)
            return
        self._at += len(octets)
        if octets:
            self._frames.receive(octets)

    def _lose(self, error: OSError) -> None:
        self._close()
        self._state = os.strerror(error.errno or 0).lower()
        self._attempts.failed(self._state, self._open)

    def _close(self) -> None:
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1


def _read(descriptor: int, at: int) -> bytes:
    """What is there now; empty while it is on a disk, which is told to bring it, or in a pipe nowhere."""
    octets = bytearray(BATCH)
    try:
        count = os.preadv(descriptor, [octets], at, os.RWF_NOWAIT)
        return bytes(octets[:count])
    except BlockingIOError:
        os.posix_fadvise(descriptor, at, BATCH, os.POSIX_FADV_WILLNEED)
        return b""
    except OSError as error:
        if error.errno == errno.EOPNOTSUPP:  # of a filesystem in memory, which never waits, or of a network
            return os.pread(descriptor, BATCH, at)
        if error.errno != errno.ESPIPE:
            raise
    with contextlib.suppress(BlockingIOError):
        return os.read(descriptor, BATCH)
    return b""
