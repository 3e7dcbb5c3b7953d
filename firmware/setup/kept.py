"""Changes of a setup, with all that is needed to revert them.

A change is written to the record before it is made, so that a power cut leaves no change without its record. Undo
restores all octets of a file unless its owner has changed it. Then it reverts only the setup's own lines.
"""

import contextlib
import json
import subprocess
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from board.runtime import state_file
from board.runtime.errors import InterfaceError, StorageError
from board.runtime.tool import environment
from firmware.setup.revert import Change, left, reverted

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
        # A second setup: later changes of the owner are not ours. After a power cut, the change may not be made yet.
        if old is not None and now not in (None, old.before):
            now = old.before if now == old.after else reverted(now, old, name)
        self._changes[name] = Change(now, after)
        self._save()
        self._put(name, after)

    def append(self, name: str, lines: bytes) -> None:
        """Add lines at the end of a file, whose last line may lack its end. Raises StorageError if that fails."""
        now = self.read(name) or b""
        self.write(name, now + (b"" if now.endswith(b"\n") or not now else b"\n") + lines)

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
        """Revert all changes, and yield a line on each; the record keeps those that fail.

        Raises StationError if a file cannot be written, or systemd does not read its units.
        """
        for name, change in reversed(list(self._changes.items())):
            try:
                said = self._revert(name, change)
            except InterfaceError as error:
                yield f"failed: {error.message}"
                continue
            del self._changes[name]
            self._save()
            yield f"/{name}: {said}"
        self.reload()
        for words in reversed(list(self._undo)):
            try:
                self._run(words)
            except InterfaceError as error:
                yield f"failed: {error.message}"
                continue
            self._undo.remove(words)
            self._save()
            yield " ".join(words)
        if self.is_empty:
            state_file.forget(self._record)
            with contextlib.suppress(OSError):
                self._record.parent.rmdir()

    def _revert(self, name: str, change: Change) -> str:
        """Revert the change of a file; return the result. Raises InterfaceError if a line of the setup stays."""
        now = self.read(name)
        if now is None and change.before is not None:
            return "is absent: nothing to revert"
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
        if not is_ours and (line := left(then, change, name)):
            raise InterfaceError(f"/{name}: could not be reverted: {line} is still there")
        if then == now:
            return "changed since the setup: has none of its lines"
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
