"""A ring of files: so many octets and seconds of all that was heard, and what was kept of it for a reason."""

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
from typing import NamedTuple

from firmware.codec.capture import PCAPNG
from firmware.recorder.filing import Filing, Segment
from firmware.recorder.hearing import say
from firmware.recorder.scribe import Scribe
from firmware.recorder.shares import Shares, key_of, word_of
from firmware.recorder.told import Told
from firmware.storage import VOLATILE, kind_of

# The ring turns in so many steps: the oldest of them goes at a time.
PARTS = 16
LEAST_S = 1.0
# An event is no longer, whatever triggers meanwhile: what follows is the next one.
LONGEST_EVENT_S = 60.0
LONGEST_WHY = 200  # characters of the reasons of an event, for the log
# Left to others on the same disk, or a twentieth of it where it is small.
LEAVE = 64 << 20
NAME = re.compile(r"(ring|kept)-(\d{8})-.*\.pcapng")

MOUNTS = Path("/proc/self/mountinfo")

log = logging.getLogger("captain.recorder")


@dataclass(frozen=True)
class Limits:
    """How much there may be.

    size             octets of the ring, and again of what is kept.
    age_s            of the ring.
    before_s, after_s  kept of an event.
    is_memory_fine   whether the folder may be in memory, as it is where a card has not been mounted.
    """

    size: int = 256 << 20
    age_s: float = 3600.0
    before_s: float = 30.0
    after_s: float = 10.0
    is_memory_fine: bool = True


class Closed(NamedTuple):
    """A file of the ring that is whole; ended as the ring's clock has it."""

    path: Path
    size: int
    ended: float

    @property
    def number(self) -> int:
        """That is in its name."""
        return int(self.path.name.split("-")[1])


class Ring:
    """Files `ring-NUMBER-TIME.pcapng` of a folder, and `kept-NUMBER-TIME-WHY.pcapng`, which stay for longer.

    clock  monotonic.
    on_file  called when the file before is whole and the next is not yet begun: what is counted now is on the disk.
    """

    def __init__(
        self, folder: Path, limits: Limits, scribe: Scribe, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.folder = folder
        self.kept = self.not_kept = 0
        self.on_file: Callable[[], None] = lambda: None
        self.number, self.is_known = 0, False  # of the last file, and whether the folder was looked at
        self.filing = Filing(scribe, self._open, self._note, clock)
        self._limits = limits
        self._clock = clock
        self._closed: list[Closed] = []
        self._shares = Shares(limits.size)
        self._begun = clock()
        self._why = self._word = ""  # all reasons of the event; the one whose share the next file counts in
        self._until = self._longest = 0.0
        self._is_whole, self._names = True, 0  # of the event: whether all, how many files are kept
        self._is_full = False  # the share that the next file counts in
        self._lock: int | None = None
        self._place = 0, 0

    def add(self, told: Told) -> None:
        self.filing.add(told)
        if self.filing.scribe.size >= self._limits.size // PARTS:
            self.filing.begin()

    def idle(self) -> None:
        """A few times a second."""
        now = self._clock()
        if self._why and now >= self._until:
            self._end_of_event()
        elif now >= self._begun + max(LEAST_S, self._limits.age_s / PARTS) and self.filing.scribe.size:
            self.filing.begin()
        self.filing.idle()

    def trigger(self, why: str) -> None:
        """Keep what was before, at once, and what comes for some seconds; a trigger meanwhile makes that longer."""
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
        with suppress(OSError):  # an operator removes what is kept, when there is enough of it
            self._shares.look(self.folder)
        say(f"kept because of {why}: {self._limits.before_s:g} s before and {self._limits.after_s:g} s after")
        before = [one for one in self._closed if one.ended >= since]
        # The file that is being written first: it has what triggers, and its name, should this be the end.
        self.filing.begin()
        for one in reversed(before):
            self._keep(one)

    def _has_less(self, word: str) -> bool:
        return self._shares.taken(key_of(word)) < self._shares.taken(key_of(self._word))

    def _share(self, word: str, now: float) -> None:
        """What comes counts in another share: in that of a station that has little, it stays for longer."""
        if now >= self._begun + LEAST_S:
            self.filing.begin()
        self._word = word
        self._is_full = False

    def close(self) -> None:
        """What was to be kept is kept."""
        if self._why:
            self._end_of_event()
        self.filing.end()
        self._let_go()

    def go_on(self, number: int) -> None:
        """Files up to this number are there already."""
        self.number, self.is_known = max(self.number, number), True

    def status(self) -> dict[str, object]:
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
        """A file that nothing more is written to; one that cannot write took what it could, one without frames goes."""
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
        """The next file, with room for it. Raises OSError."""
        if not self._limits.is_memory_fine and kind_of(MOUNTS, self.folder) in VOLATILE:
            raise OSError(errno.ENODEV, "it is in memory: its card is not mounted", str(self.folder))
        self._claim()
        self.on_file()
        self._prune()
        self._begun = self._clock()
        self.number += 1
        when = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime())
        return Segment(self.folder / f"ring-{self.number:08d}-{when}.pcapng")

    def _claim(self) -> None:
        """Make the folder this recorder's, and know what is in it: another card is another folder."""
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
            raise OSError(errno.EBUSY, "another recorder writes into this folder", str(self.folder)) from None
        except OSError:
            os.close(lock)
            raise
        self._lock, self._place = lock, (found.st_dev, found.st_ino)

    def _let_go(self) -> None:
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    def _look(self) -> None:
        """What earlier runs have left: the last may end in the middle of a block."""
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
        """Remove the oldest until the next one has its room. Raises OSError where there is none."""
        part = self._limits.size // PARTS
        while self._closed and self._is_too_much(part):
            self._closed[0].path.unlink(missing_ok=True)
            self._closed.pop(0)
        if (free := _room(self.folder)) <= 0:
            raise OSError(errno.ENOSPC, f"no room: {-free} octets less than are left to others", str(self.folder))

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
        """Give a file the name by which it stays, where its share has room for it."""
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
        """What follows is not kept either, so that what is kept has no gap."""
        if self._is_whole:
            say(f"not all is kept: {self._why}: more than its share of {self._limits.size} octets")
        self._is_full, self._is_whole = True, False


def mend(path: Path) -> None:
    """Cut a recording off after its last whole block: the power may have failed. Raises OSError.

    One without any is removed; what begins otherwise is no recording, and left alone.
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
    """Octets that may still be written into a folder; less than 0 where others need them."""
    found = os.statvfs(folder)
    size = found.f_blocks * found.f_frsize
    return found.f_bavail * found.f_frsize - min(LEAVE, size // 20)
