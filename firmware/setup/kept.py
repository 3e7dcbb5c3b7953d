"""Changes of a setup, with all that is needed to revert them.

A change is written to the record before it is made, so that a power cut leaves no change without its record. Undo
restores all octets of a file unless its owner has changed it. Then it reverts only the setup's own lines.
"""

import contextlib
import json
import subprocess
from collections.abc import Callable, Iterator, Sequence
from difflib import SequenceMatcher
from pathlib import Path
from typing import NamedTuple

from board.runtime import state_file
from board.runtime.errors import InterfaceError, StorageError
from board.runtime.tool import environment

RECORD = "var/lib/captain-box/setup.json"
MOST = 1 << 20  # octets of a file; config.txt has 2 kB
LIMIT_S = 60.0  # limit of a command; systemctl waits for a start

Run = Callable[[Sequence[str]], None]


def run(words: Sequence[str]) -> None:
    """Run a command of the system. Raises InterfaceError with its last line if it fails or is missing."""
    try:
        ended = subprocess.run(
            words, stdin=subprocess.DEVNULL, capture_output=True, text=True, errors="replace",
            env=environment(), timeout=LIMIT_S, check=False,
        )  # fmt: skip
    except (OSError, subprocess.TimeoutExpired) as error:
        raise InterfaceError(f"{' '.join(words)}: {error}") from error
    if ended.returncode != 0:
        said = (ended.stderr.strip() or ended.stdout.strip()).splitlines()
        raise InterfaceError(f"{' '.join(words)}: {said[-1] if said else f'exit status {ended.returncode}'}")


class Change(NamedTuple):
    """Change of one file. before: None if the file was absent."""

    before: bytes | None
    after: bytes


class Kept:
    """Record of all changes below a root.

    root  `/`, or the root of another system.
    run   runs a command of the system.

    Raises StorageError if the record cannot be read.
    """

    def __init__(self, root: Path, run: Run = run) -> None:
        self.root = root
        self._run = run
        self._record = root / RECORD
        self._changes: dict[str, Change] = {}
        self._undo: list[list[str]] = []  # commands, run from the last to the first
        self._load()

    @property
    def is_empty(self) -> bool:
        return not self._changes and not self._undo

    def read(self, name: str) -> bytes | None:
        """Return a file by its path below the root; None if absent. Raises StorageError if it cannot be read."""
        return state_file.read(self.root / name, MOST)

    def write(self, name: str, after: bytes) -> None:
        """Replace a file, and keep its former content. Raises StorageError if that fails."""
        now, old = self.read(name), self._changes.get(name)
        if old is not None and now is not None:  # a second setup: later changes of the owner are not ours
            now = old.before if now == old.after else reverted(now, old, name)
        self._changes[name] = Change(now, after)
        self._save()
        self._put(name, after)

    def run(self, words: Sequence[str], undo: Sequence[str]) -> None:
        """Run a command, and keep the one that reverts it. Raises InterfaceError if it fails."""
        self._undo.append(list(undo))
        self._save()
        try:
            self._run(words)
        except InterfaceError:
            self._undo.pop()
            self._save()
            raise

    def reload(self) -> None:
        """Let systemd, if it runs here, read its units again. Raises InterfaceError if that fails."""
        if is_running(self.root):
            self._run(["systemctl", "daemon-reload"])

    def undo(self) -> Iterator[str]:
        """Revert all changes, and yield a line on each. Raises StationError if one fails; the record keeps the rest."""
        for name in reversed(list(self._changes)):
            yield f"/{name}: {self._revert(name, self._changes[name])}"
            del self._changes[name]
            self._save()
        self.reload()
        while self._undo:
            words = self._undo[-1]
            try:
                self._run(words)
                yield " ".join(words)
            except InterfaceError as error:
                yield f"failed: {error.message}"
            self._undo.pop()
            self._save()
        state_file.forget(self._record)
        with contextlib.suppress(OSError):
            self._record.parent.rmdir()

    def _revert(self, name: str, change: Change) -> str:
        now = self.read(name)
        if now is None or now == change.before:
            return "is as before"
        is_ours = now == change.after
        then = change.before if is_ours else reverted(now, change, name)
        if then is None or (change.before is None and not then.strip()):
            state_file.forget(self.root / name)
            with contextlib.suppress(OSError):
                if name.endswith(".d/captain-setup.conf"):
                    (self.root / name).parent.rmdir()
            return "removed"
        self._put(name, then)
        return "as before" if is_ours else "changed since the setup: only its own lines are removed"

    def _put(self, name: str, octets: bytes) -> None:
        path = self.root / name
        try:
            mode = path.stat().st_mode & 0o777 if path.exists() else 0o644
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise state_file.refused(path, "written", error) from error
        state_file.keep(path, octets, mode)

    def _load(self) -> None:
        octets = state_file.read(self._record, 4 * MOST)
        if octets is None:
            return
        try:
            found = json.loads(octets)
            self._undo = [[str(word) for word in words] for words in found["undo"]]
            for name, (before, after) in found["files"].items():
                self._changes[name] = Change(
                    None if before is None else before.encode("latin-1"), after.encode("latin-1")
                )
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            hint = "remove it, and revert the settings by hand"
            raise StorageError(f"{self._record}: is not a record of a setup", hint) from error

    def _save(self) -> None:
        files = {
            name: [None if one.before is None else one.before.decode("latin-1"), one.after.decode("latin-1")]
            for name, one in self._changes.items()
        }
        with contextlib.suppress(OSError):  # the write reports why
            self._record.parent.mkdir(parents=True, exist_ok=True)
        state_file.keep(self._record, json.dumps({"files": files, "undo": self._undo}, indent=1).encode())


def is_running(root: Path) -> bool:
    """Return True if systemd runs in this root: sd_booted(3)."""
    return (root / "run/systemd/system").is_dir()


def reverted(now: bytes, change: Change, name: str) -> bytes:
    """Return a file without a change, with all that others have changed since.

    The units are lines; those of cmdline.txt, which is one line, are its words.
    """
    if name.endswith("cmdline.txt"):
        line = now.rstrip(b"\r\n")
        before, after = ((octets or b"").rstrip(b"\r\n").split(b" ") for octets in change)
        return b" ".join(_reverted(line.split(b" "), before, after)) + now[len(line) :]
    before, after = ((octets or b"").splitlines(keepends=True) for octets in change)
    return b"".join(_reverted(now.splitlines(keepends=True), before, after))


def _reverted(units: list[bytes], before: list[bytes], after: list[bytes]) -> list[bytes]:
    for kind, first, last, begin, end in reversed(SequenceMatcher(None, before, after, False).get_opcodes()):
        if kind == "equal":
            continue
        ours = after[begin:end]
        at = _place(units, ours) if ours else _after(units, after[:begin])
        if at is not None:
            units[at : at + len(ours)] = before[first:last]
    return units


def _place(units: list[bytes], ours: list[bytes]) -> int | None:
    """Return the last index of a run of units; None if it is absent."""
    places = range(len(units) - len(ours), -1, -1)
    return next((at for at in places if units[at : at + len(ours)] == ours), None)


def _after(units: list[bytes], above: list[bytes]) -> int:
    """Return the index after the unit above; 0 without it."""
    return units.index(above[-1]) + 1 if above and above[-1] in units else 0
