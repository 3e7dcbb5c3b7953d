"""Corrections from a file that may grow, or from a pipe."""

import contextlib
import errno
import os

from drivers.contract import Host
from drivers.gnss.corrections.attempts import Attempts
from drivers.gnss.corrections.frames import BATCH, Frames, Take

# Interval of the reads. A file is replayed at about 4000 octets per second, the speed of a line at 38,400 baud. RTCM
# for four satellite systems needs a quarter of that, so the reader catches up with a growing file.
PERIOD_S = 0.25


class FileCorrections:
    """Replays a file or pipe, then reads octets that are appended to it. The file may be created later."""

    def __init__(self, path: str, host: Host, take: Take) -> None:
        self._path = path
        self._frames = Frames(host, take)
        self._attempts = Attempts(path, host, self._frames)
        self._descriptor = -1
        self._at = 0  # number of octets read so far
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
            # The open never blocks: with O_NONBLOCK a pipe without a writer opens and is empty.
            self._descriptor = os.open(self._path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
            if os.fstat(self._descriptor).st_size < self._at:
                self._at = 0  # the file was replaced or emptied
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
    """Return the octets at an offset that can be read without blocking; empty if none can.

    For octets that are only on the disk, the kernel is asked to load them, and a later call returns them.
    """
    octets = bytearray(BATCH)
    try:
        count = os.preadv(descriptor, [octets], at, os.RWF_NOWAIT)
        return bytes(octets[:count])
    except BlockingIOError:
        os.posix_fadvise(descriptor, at, BATCH, os.POSIX_FADV_WILLNEED)
        return b""
    except OSError as error:
        if error.errno == errno.EOPNOTSUPP:  # the file is in memory, where reads never block, or on a network
            return os.pread(descriptor, BATCH, at)
        if error.errno != errno.ESPIPE:
            raise
    with contextlib.suppress(BlockingIOError):
        return os.read(descriptor, BATCH)
    return b""
