"""Storage: checks the station's folder for persistent files; counts starts in it.

The station also runs without this folder. If the folder is absent, full, in memory or read-only, the status shows the
cause, the number of failed writes and the remedy. The log has each change.
"""

import json
import logging
import os
import time
from enum import StrEnum
from pathlib import Path

from board.machine import REAL, Machine
from board.runtime import state_file
from board.runtime.errors import StorageError
from board.runtime.loop import Loop

FOLDER = "STATE_DIRECTORY"  # environment variable of systemd with the folder's path; if unset, no folder is expected
FILE = "starts.json"
MOST = 4096  # largest number of octets that are read from FILE
LOOK_S = 10.0
LEAST_OCTETS = 1 << 20  # free space below which the folder counts as full
FIRST_S = 1.0  # delay until the start is recorded, so that the station's start does not wait for the disk
# Types of file systems that are lost at power-off. The image's /etc is on one of them.
VOLATILE = frozenset({"tmpfs", "ramfs", "overlay", "rootfs"})

log = logging.getLogger("captain.storage")


class Kept(StrEnum):
    """State of the folder: `kept`, or the cause why files are lost."""

    YES = "kept"
    ABSENT = "absent"
    READ_ONLY = "read-only"
    MEMORY = "memory"
    FULL = "full"
    DENIED = "denied"


HINTS = {
    Kept.ABSENT: "the data partition is not mounted: see the first lines of the serial console",
    Kept.READ_ONLY: "the card refuses writes, as worn-out cards do: replace it",
    Kept.MEMORY: "files are lost at power-off: no data partition; see the first lines of the serial console",
    Kept.FULL: "no free space: remove recordings, or use a larger card",
    Kept.DENIED: "give the folder to the station's user",
}


class Storage:
    """Check of the folder, every LOOK_S seconds.

    folder  absolute path; empty: no folder is expected, and nothing is reported. None: from $STATE_DIRECTORY.
    """

    def __init__(self, loop: Loop, folder: str | None = None, machine: Machine = REAL) -> None:
        self._loop = loop
        self._folder = Path(os.environ.get(FOLDER, "").partition(":")[0] if folder is None else folder)
        self._is_expected = bool(self._folder.parts)
        self._mounts = machine.proc / "self/mountinfo"
        self._state = Kept.YES
        self._starts = self._unclean = 0
        self._is_noted = self._is_over = False

    def start(self) -> None:
        if self._is_expected:
            self._loop.after(FIRST_S, lambda: self._loop.every(LOOK_S, self._look))

    def stop(self) -> None:
        """Record that this run has ended normally; a second call has no effect."""
        if self._is_noted and not self._is_over:
            self._keep(is_running=False)
        self._is_over = True

    def status(self) -> dict[str, object]:
        """Return the storage's part of the status; empty if no folder is expected.

        folder          path of the folder.
        state           `kept`; or the cause why files do not outlive a restart: `absent`, `full`, `read-only`, `memory`
                        or `denied`.
        hint            remedy; empty once a write succeeds.
        free_octets     free space in octets.
        refused         number of failed writes.
        last_refusal    error of the last failed write; may be empty.
        starts          number of starts of the station.
        unclean_starts  number of starts after a run that did not end normally, for example because of a power cut.
        """
        if not self._is_expected:
            return {}
        refusals = state_file.REFUSALS
        return {
            "folder": str(self._folder),
            "state": str(self._state),
            "hint": HINTS.get(self._state, refusals.hint),
            "free_octets": _free_octets(self._folder),
            "refused": refusals.count,
            "last_refusal": refusals.last,
            "starts": self._starts,
            "unclean_starts": self._unclean,
        }

    def _look(self) -> None:
        before, self._state = self._state, self._found()
        if self._state is not before:
            if self._state is Kept.YES:
                log.info("%s: files are kept again", self._folder)
            else:
                log.warning("%s: %s: %s", self._folder, self._state, HINTS[self._state])
        is_again = self._state is Kept.YES and before is not Kept.YES  # usable again: a write clears the hint
        is_due = not self._is_noted and (self._state is Kept.YES or not self._starts)
        if (is_again or is_due) and not self._is_over:
            self._note()

    def _found(self) -> Kept:
        try:
            found = os.statvfs(self._folder)
        except OSError:
            return Kept.ABSENT
        if found.f_flag & os.ST_RDONLY:
            return Kept.READ_ONLY
        if kind_of(self._mounts, self._folder) in VOLATILE:
            return Kept.MEMORY
        if found.f_bavail * found.f_frsize < LEAST_OCTETS or (found.f_files and not found.f_favail):
            return Kept.FULL
        return Kept.YES if os.access(self._folder, os.W_OK | os.X_OK) else Kept.DENIED

    def _note(self) -> None:
        """Record this start. If the previous run did not record its end, count an unclean start."""
        if not self._starts:
            told = self._read()
            self._starts = _count(told, "starts") + 1
            self._unclean = _count(told, "unclean_starts") + (told.get("is_running") is True)
        self._is_noted = self._keep(is_running=True)

    def _keep(self, is_running: bool) -> bool:
        told = {
            "starts": self._starts,
            "unclean_starts": self._unclean,
            "is_running": is_running,
            "time": int(time.time()),
        }
        try:
            state_file.keep(self._folder / FILE, json.dumps(told).encode())
        except StorageError as error:
            log.debug("%s", error.message)  # at debug level only, because the status shows count and cause
            return False
        return True

    def _read(self) -> dict[str, object]:
        try:
            found = json.loads(state_file.read(self._folder / FILE, MOST) or b"{}")
        except (StorageError, ValueError) as error:
            log.warning("%s: counted anew: %s", self._folder / FILE, error)
            return {}
        return found if isinstance(found, dict) else {}


def _count(told: dict[str, object], key: str) -> int:
    value = told.get(key)
    return value if isinstance(value, int) and value > 0 else 0


def _free_octets(folder: Path) -> int:
    try:
        found = os.statvfs(folder)
    except OSError:
        return 0
    return found.f_bavail * found.f_frsize


def kind_of(mounts: Path, folder: Path) -> str:
    """Return the type of a folder's file system, such as `ext4`; empty if unknown.

    mounts  /proc/self/mountinfo. Source: Linux, Documentation/filesystems/proc.rst, 3.5.
    """
    try:
        lines = mounts.read_text("utf-8", "surrogateescape").splitlines()
    except OSError:
        return ""
    place, best, found = os.path.realpath(folder), -1, ""
    for line in lines:
        its, _, more = line.partition(" - ")
        if its.count(" ") < 4:
            continue
        point = its.split(" ")[4].replace("\\040", " ")
        is_above = place == point or place.startswith(f"{point.rstrip('/')}/")
        if is_above and len(point) >= best:  # a later mount hides an earlier one at the same place
            best, found = len(point), more.split(" ")[0]
    return found
