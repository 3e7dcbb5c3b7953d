"""The folder that outlives a restart: whether it does, and how many starts it has seen.

The station runs without it. A folder that is absent, full, in memory or on a card that takes no writes is told, in the
log when that changes and in every status, with what was refused and what to do.
"""

import json
import logging
import os
import time
from enum import StrEnum
from pathlib import Path

from board import state_file
from board.errors import StorageError
from board.loop import Loop
from board.machine import REAL, Machine

FOLDER = "STATE_DIRECTORY"  # of the environment, as systemd names it; unset: nobody expects that anything is kept
FILE = "starts.json"
MOST = 4096  # octets of it
LOOK_S = 10.0
LEAST_OCTETS = 1 << 20  # free: less is full
FIRST_S = 1.0  # a start is written down once the station runs: nobody waits for the card before
VOLATILE = frozenset({"tmpfs", "ramfs", "overlay", "rootfs"})  # kinds of file systems; the image has /etc on such

log = logging.getLogger("captain.storage")


class Kept(StrEnum):
    """What becomes of what is written."""

    YES = "kept"
    ABSENT = "absent"
    READ_ONLY = "read-only"
    MEMORY = "memory"
    FULL = "full"
    DENIED = "denied"


HINTS = {
    Kept.ABSENT: "the data partition is not mounted: look at the first lines of the serial console",
    Kept.READ_ONLY: "the card takes no writes: one that is worn out does so; take another one",
    Kept.MEMORY: "all is lost at power-off: the data partition could not be used; see the serial console's first lines",
    Kept.FULL: "there is no room: remove recordings, or take a larger card",
    Kept.DENIED: "give the folder to the station's user",
}


class Storage:
    """Looked at every ten seconds.

    folder  absolute; empty: none is expected, and nothing is said.
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
        """Write down that this run has ended as it should. Idempotent."""
        if self._is_noted and not self._is_over:
            self._keep(is_running=False)
        self._is_over = True

    def status(self) -> dict[str, object]:
        """As JSON; empty where no folder is expected."""
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
                log.info("%s: what is written is kept again", self._folder)
            else:
                log.warning("%s: %s: %s", self._folder, self._state, HINTS[self._state])
        is_again = self._state is Kept.YES and before is not Kept.YES  # a write that is taken ends what was refused
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
        """Write this start down. A run that did not write down its end had none: the power went, or it was killed."""
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
            log.debug("%s", error.message)  # it is counted, and the folder's state is told
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
    """Of the file system that a folder lies on. Source: Linux, Documentation/filesystems/proc.rst, 3.5."""
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
        if is_above and len(point) >= best:  # of two at one place the later one hides the other
            best, found = len(point), more.split(" ")[0]
    return found
