"""Ring of recordings: bounded in size and age, keeps files around events."""

import errno
import fcntl
import logging
import os
import re
import struct
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, Protocol

from firmware.recorder.filing import Filing, Segment
from firmware.recorder.hearing import say
from firmware.recorder.reported_frame import ReportedFrame
from firmware.recorder.scribe import Scribe
from firmware.recorder.shares import Shares, key_of, word_of
from firmware.recordings.capture import PCAPNG
from firmware.station.storage import VOLATILE, kind_of

# Number of files into which the ring's size and age are divided; the oldest is deleted to make room for the next.
PARTS = 16
LEAST_S = 1.0
# Limit of one event; a later trigger begins another event.
LONGEST_EVENT_S = 60.0
LONGEST_WHY = 200  # characters of an event's reasons in the log
# Room left free on the disk for other programs; on a small disk, a twentieth of its size.
LEAVE = 64 << 20
NAME = re.compile(r"(ring|kept)-(\d{8})-.*\.pcapng")

MOUNTS = Path("/proc/self/mountinfo")

log = logging.getLogger("captain.recorder")


@dataclass(frozen=True)
class Limits:
    """Limits of a ring.

    size             octets of the ring; kept files may use as much again.
    age_s            age of the oldest file in seconds.
    before_s         seconds kept before an event.
    after_s          seconds kept after an event.
    is_memory_fine   the folder may be in memory, such as the mount point of an unmounted card.
    """

    size: int = 256 << 20
    age_s: float = 3600.0
    before_s: float = 30.0
    after_s: float = 10.0
    is_memory_fine: bool = True


class Closed(NamedTuple):
    """Completed file of the ring; ended: time of its end by the ring's clock."""

    path: Path
    size: int
    ended: float

    @property
    def number(self) -> int:
        """Number in the file's name."""
        return int(self.path.name.split("-")[1])


class FileListener(Protocol):
    """Receiver of notices that a file is complete."""

    def file_closed(self) -> None:
        """Take the notice between two files, when all counted frames are on the disk."""


class Ring:
    """Files `ring-NUMBER-TIME.pcapng` of a folder, and kept files `kept-NUMBER-TIME-WHY.pcapng`.

    clock     monotonic clock in seconds.
    listener  notified of each completed file; None: no notices.
    """

    def __init__(
        self, folder: Path, limits: Limits, scribe: Scribe, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.folder = folder
        self.kept = self.not_kept = 0
        self.listener: FileListener | None = None
        self.number, self.is_known = 0, False  # number of the last file, and whether the folder was read
        self.filing = Filing(scribe, self._open, self._note, clock)
        self._limits = limits
        self._clock = clock
        self._closed: list[Closed] = []
        self._shares = Shares(limits.size)
        self._begun = clock()
        # All reasons of the current event, and the reason whose share counts the next kept file.
        self._why = self._word = ""
        self._until = self._longest = 0.0
        # State of the current event: whether all its files were kept, and the number of kept files.
        self._is_whole, self._names = True, 0
        self._is_full = False  # True if the share of _word has no room for another file
        self._lock: int | None = None
        self._place = 0, 0

    def add(self, told: ReportedFrame) -> None:
        self.filing.add(told)
        if self.filing.scribe.size >= self._limits.size // PARTS:
            self.filing.begin()

    def idle(self) -> None:
        """Begin the next file or end an event when it is due. The caller calls it a few times a second."""
        now = self._clock()
        if self._why and now >= self._until:
            self._end_of_event()
        elif now >= self._begun + max(LEAST_S, self._limits.age_s / PARTS) and self.filing.scribe.size:
            self.filing.begin()
        self.filing.idle()

    def trigger(self, why: str) -> None:
        """Keep the files of before_s before now and after_s after it.

        A further trigger extends the time, at most to LONGEST_EVENT_S.

        why  reason, which becomes part of the file names.
        """
        now = self._clock()
        after_s, word = self._limits.after_s, word_of(why)
        if not self._why:
            self._longest = now + max(after_s, LONGEST_EVENT_S)
            self._begin_event(why, word, now - self._limits.before_s)
        elif word != self._word and self._has_less(word):
            self._why += f" {why}" if len(self._why) < LONGEST_WHY else ""
            self._share(word, now)
        self._until = min(now + after_s, self._longest)

    def _begin_event(self, why: str, word: str, since: float) -> None:
        self._why, self._word = why, word
        self._is_whole, self._names = True, 0
        self._is_full = False
        with suppress(OSError):  # the folder cannot be read, for example because the card was removed
            self._shares.look(self.folder)
        say(f"{why}: keeping {self._limits.before_s:g} s before and {self._limits.after_s:g} s after")
        before = [one for one in self._closed if one.ended >= since]
        # The current file is closed and kept first, because it contains the trigger itself.
        self.filing.begin()
        for one in reversed(before):
            self._keep(one)

    def _has_less(self, word: str) -> bool:
        return self._shares.taken(key_of(word)) < self._shares.taken(key_of(self._word))

    def _share(self, word: str, now: float) -> None:
        """Count further files of the event in the share of another reason.

        The caller chooses a reason with less kept data, whose files are removed later.
        """
        if now >= self._begun + LEAST_S:
            self.filing.begin()
        self._word = word
        self._is_full = False

    def close(self) -> None:
        """End the current event, complete the file and release the folder."""
        if self._why:
            self._end_of_event()
        self.filing.end()
        self._let_go()

    def go_on(self, number: int) -> None:
        """Continue numbering files after this number, and mark the folder as read."""
        self.number, self.is_known = max(self.number, number), True

    def status(self) -> dict[str, object]:
        """Return the ring's part of the status.

        folder        folder of the ring.
        file          name of the current file; empty if no file is open.
        octets        size of the ring's files.
        files         number of completed files.
        kept          number of events whose files were all kept.
        kept_octets   size of the kept files.
        kept_removed  number of kept files that were removed for newer ones.
        not_kept      number of events that were not completely kept.
        frames        number of recorded frames.
        lost          number of lost frames.
        lost_by.way   frames lost between station and recorder.
        lost_by.disk  frames lost because the disk was full or absent.
        lost_by.restart  frames lost in a restart of the recorder.
        trouble       current error of the disk; empty without one.
        troubles      number of disk errors.
        """
        filing = self.filing
        return {
            "folder": str(self.folder),
            "file": filing.path.name if filing.path else "",
            "octets": sum(one.size for one in self._closed) + filing.scribe.size,
            "files": len(self._closed),
            "kept": self.kept,
            "kept_octets": self._shares.size,
            "kept_removed": self._shares.removed,
            "not_kept": self.not_kept,
            "frames": filing.scribe.frames,
            "lost": filing.scribe.lost,
            "lost_by": self._lost_by(),
            "trouble": filing.trouble,
            "troubles": filing.troubles,
        }

    def _lost_by(self) -> dict[str, int]:
        scribe = self.filing.scribe
        disk = scribe.lost - scribe.missing - scribe.killed
        return {"way": scribe.missing, "disk": disk, "restart": scribe.killed}

    def _note(self, path: Path, frames: int) -> None:
        """Add a completed file to the ring, and keep it during an event; remove it if it has no frames."""
        try:
            if not frames:
                path.unlink(missing_ok=True)
                return
            one = Closed(path, path.stat().st_size, self._clock())
        except OSError:
            log.debug("%s is gone", path)
            return
        self._closed.append(one)
        if self._why:
            self._keep(one)

    def _open(self) -> Segment:
        """Open the next file after removing old ones.

        Raises OSError if the folder has no room, is locked or in memory.
        """
        if not self._limits.is_memory_fine and kind_of(MOUNTS, self.folder) in VOLATILE:
            raise OSError(errno.ENODEV, "in memory: the card is not mounted", str(self.folder))
        self._claim()
        if self.listener is not None:
            self.listener.file_closed()
        self._prune()
        self._begun = self._clock()
        self.number += 1
        when = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime())
        return Segment(self.folder / f"ring-{self.number:08d}-{when}.pcapng")

    def _claim(self) -> None:
        """Lock and read the folder, unless it is still the same one: a replaced card is another folder.

        Raises OSError if another recorder has locked it.
        """
        found = os.stat(self.folder)
        if self._lock is not None and (found.st_dev, found.st_ino) == self._place:
            return
        self._let_go()
        lock = os.open(self.folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            self._look()
        except BlockingIOError:
            os.close(lock)
            raise OSError(errno.EBUSY, "another recorder writes to this folder", str(self.folder)) from None
        except OSError:
            os.close(lock)
            raise
        self._lock, self._place = lock, (found.st_dev, found.st_ino)

    def _let_go(self) -> None:
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    def _look(self) -> None:
        """Find the files of earlier runs, and truncate the last one after its last whole block."""
        now = self._clock()
        found = [(path, match) for path in self.folder.iterdir() if (match := NAME.fullmatch(path.name))]
        names = sorted((int(match[2]), path, match[1]) for path, match in found)
        if names:
            mend(names[-1][1])
        self._closed = []
        for _, path, kind in names:
            if kind == "ring" and path.exists():
                status = path.stat()
                self._closed.append(Closed(path, status.st_size, now - max(0.0, time.time() - status.st_mtime)))
        self._shares.look(self.folder)
        self.go_on(names[-1][0] if names else 0)

    def _prune(self) -> None:
        """Remove the oldest files until the next one has room. Raises OSError if the disk has no room even then."""
        part = self._limits.size // PARTS
        while self._closed and self._is_too_much(part):
            self._closed[0].path.unlink(missing_ok=True)
            self._closed.pop(0)
        if (free := _room(self.folder)) <= 0:
            raise OSError(errno.ENOSPC, f"no room: {-free} octets short of the part that stays free", str(self.folder))

    def _is_too_much(self, part: int) -> bool:
        oldest = self._closed[0].ended < self._clock() - self._limits.age_s
        return oldest or sum(one.size for one in self._closed) + part > self._limits.size or _room(self.folder) < part

    def _end_of_event(self) -> None:
        self.filing.end()
        self._why = ""
        if self._is_whole and self._names:
            self.kept += 1
        else:
            self.not_kept += 1
        self.filing.begin()

    def _keep(self, one: Closed) -> None:
        """Keep a file by renaming it, if its share has room; otherwise report the event as incomplete."""
        try:
            if self._is_full or not self._shares.is_room(one.size, key_of(self._word)):
                self._lacks_room()
                return
            self._shares.keep(one.path, one.size, self._word)
        except OSError as error:
            say(f"{one.path}: not kept: {error.strerror}")
            self._is_whole = False
            return
        self._names += 1
        self._closed.remove(one)

    def _lacks_room(self) -> None:
        """Keep no further file of the event, so that the kept files have no gap between them."""
        if self._is_whole:
            say(f"{self._why}: not completely kept: larger than its share of {self._limits.size} octets")
        self._is_full, self._is_whole = True, False


def mend(path: Path) -> None:
    """Truncate a recording after its last whole block, as needed after a power failure. Raises OSError.

    A file without a whole block is removed. A file that is not a recording is left unchanged.
    """
    with path.open("r+b") as file:
        size, good = os.fstat(file.fileno()).st_size, 0
        if file.read(len(PCAPNG)) != PCAPNG[:size]:
            return
        while good + 12 <= size:
            file.seek(good)
            _, length = struct.unpack("<II", file.read(8))
            if length < 12 or length % 4 or good + length > size:
                break
            good += length
        file.truncate(good)
    if not good:
        path.unlink()


def _room(folder: Path) -> int:
    """Return the octets that may still be written to a folder; negative if less than the reserve is free."""
    found = os.statvfs(folder)
    size = found.f_blocks * found.f_frsize
    return found.f_bavail * found.f_frsize - min(LEAVE, size // 20)
