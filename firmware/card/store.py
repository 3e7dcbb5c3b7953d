"""Accepted sets on the data partition: exactly one is in force.

/data/owner/KEY/     captain.toml, board.toml, authorized_keys, mqtt/, lib/, and made/: files for / by their paths
/data/owner/current  a link to the set in force
/data/owner/spare    a link to a set with ssh keys only, before the first accepted set
/data/owner/looked   of the last checked set: its key, the LED's blink code, notes
"""

import os
import pwd
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from board.runtime.state_file import keep, settle
from firmware.card.card import FOLDERS, is_kept
from firmware.card.system_files import SystemFile

STATION = "captain"  # user of the station
CURRENT, SPARE, LOOKED = "current", "spare", "looked"


System = Mapping[str, SystemFile]  # by path from the root folder


class Store:
    """Folder of sets, /data/owner. A set is synced to the card before it is activated."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    @property
    def has_current(self) -> bool:
        return (self._folder / CURRENT).is_dir()

    def accept(self, key: str, keys: Sequence[str], files: Mapping[str, bytes], laid: System) -> None:
        """Activate a set and delete the previous one. Raises OSError on failure; the previous one then stays active."""
        self._write(key, keys, files, laid)
        self._link(CURRENT, key)
        self._clean(key)

    def keep_keys(self, key: str, keys: Sequence[str]) -> None:
        """Keep the ssh keys of a rejected set while no set is active, so that the owner is not locked out."""
        name = f"{key}-keys"
        self._write(name, keys, {}, {})
        self._link(SPARE, name)
        self._clean(name)

    def tell(self, key: str, blinks: int, lines: Sequence[str]) -> None:
        """Store the result of the check, so that the same set is not checked again. Raises StorageError on failure."""
        text = "".join(f"{line}\n" for line in (key, blinks, *lines))
        keep(self._folder / LOOKED, text.encode(errors="backslashreplace"))  # a file name may not be UTF-8

    def _write(self, name: str, keys: Sequence[str], files: Mapping[str, bytes], laid: System) -> None:
        target = self._folder / name
        if target.is_dir():  # it is complete, because it was renamed at the end
            return
        self._folder.mkdir(exist_ok=True)
        new = self._folder / f"{name}.new"
        shutil.rmtree(new, ignore_errors=True)
        new.mkdir(mode=0o755)
        _put(new / "authorized_keys", "".join(f"{line}\n" for line in keys).encode(), 0o644)
        for path, octets in files.items():
            _put(_above(new / path), octets, 0o600 if is_kept(path) else 0o640)
            _give(new / path, is_own=is_kept(path))
        for path, one in laid.items():
            place = _above(new / "made" / path)
            if one.target:
                place.symlink_to(one.target)
            else:
                _put(place, one.text.encode(), one.mode)
        for folder in _folders(new):
            settle(folder)
        os.rename(new, target)
        settle(self._folder)

    def _link(self, name: str, target: str) -> None:
        new = self._folder / f"{name}.new"
        new.unlink(missing_ok=True)
        new.symlink_to(target)
        os.rename(new, self._folder / name)
        settle(self._folder)

    def _clean(self, kept: str) -> None:
        """Delete other sets, and partial ones that a power cut left."""
        if (spare := self._folder / SPARE).is_symlink() and os.readlink(spare) != kept:
            spare.unlink()
        for path in self._folder.iterdir():
            if path.is_dir() and not path.is_symlink() and path.name != kept:
                shutil.rmtree(path, ignore_errors=True)


def _above(path: Path) -> Path:
    """Make the folders above a path; return the path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.parent.name in FOLDERS:
        path.parent.chmod(0o750)
        _give(path.parent)
    return path


def _put(path: Path, octets: bytes, mode: int) -> None:
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, 0o600)
    with os.fdopen(descriptor, "wb") as file:
        file.write(octets)
        file.flush()
        os.fchmod(descriptor, mode)
        os.fsync(descriptor)


def _give(path: Path, is_own: bool = False) -> None:
    """Let the station's user read a file, or own it; without effect on a machine without this user."""
    with suppress(KeyError):
        user = pwd.getpwnam(STATION)
        os.chown(path, user.pw_uid if is_own else -1, user.pw_gid)


def _folders(top: Path) -> Iterator[Path]:
    yield from (Path(folder) for folder, _, _ in os.walk(top, topdown=False))
