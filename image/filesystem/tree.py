"""File tree in memory, written as a tar with owners, without root."""

import fnmatch
import io
import tarfile
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from image.errors import ImageError

# Folders that are links into /usr in Debian's merged layout.
MERGED = ("bin", "sbin", "lib")


class Entry(NamedTuple):
    """File, folder or link. head: its metadata; content: returns its octets."""

    head: tarfile.TarInfo
    content: Callable[[], bytes]


class Tree:
    """Files by path, without a leading slash."""

    def __init__(self) -> None:
        self._entries: dict[str, Entry] = {}
        self._open: list[tarfile.TarFile] = []

    def __enter__(self) -> "Tree":
        return self

    def __exit__(self, *_: object) -> None:
        for archive in self._open:
            archive.close()

    def __contains__(self, path: str) -> bool:
        return _place(path) in self._entries

    def __iter__(self) -> Iterator[tuple[str, Entry]]:
        """Iterate in sorted order, so that a folder comes before its contents."""
        return iter(sorted(self._entries.items()))

    def read(self, path: str) -> bytes:
        """Return the content of a file. Raises ImageError if it is absent."""
        if path not in self:
            raise ImageError(f"{path}: is not in the image's files")
        return self._entries[_place(path)].content()

    def matching(self, pattern: str) -> list[str]:
        """Return the paths that match a pattern; * also matches slashes."""
        return fnmatch.filter(sorted(self._entries), pattern)

    def add_tar(self, path: Path) -> None:
        """Add a tar with its owners; hard links become copies. The tar stays open: use the tree in a `with`."""
        archive = tarfile.open(path)  # noqa: SIM115 - read while the tree is saved
        self._open.append(archive)
        for member in archive:
            name = _place(member.name)
            if not name or member.ischr() or member.isblk():
                continue  # the running kernel makes devices
            if member.islnk():
                self._entries[name] = self._entries[_place(member.linkname)]._replace(
                    head=_copied(member, tarfile.REGTYPE)
                )
            else:
                self._entries[name] = Entry(_copied(member), _reader(archive, member))

    def add_folder(self, folder: Path, below: str) -> None:
        """Add the contents of a folder of the build machine, owned by root. below: target folder."""
        for path in sorted(folder.rglob("*")):
            place = f"{below}/{path.relative_to(folder).as_posix()}"
            if path.is_symlink():
                self.link(place, str(path.readlink()))
            elif path.is_dir():
                self.folder(place)
            else:
                self._file(place, path.read_bytes, 0o755 if path.stat().st_mode & 0o100 else 0o644)

    def write(self, path: str, content: str | bytes, mode: int = 0o644) -> None:
        octets = content.encode() if isinstance(content, str) else content
        self._file(path, lambda: octets, mode)

    def _file(self, path: str, content: Callable[[], bytes], mode: int) -> None:
        self._add(path, tarfile.REGTYPE, mode, content)

    def folder(self, path: str, mode: int = 0o755, owner: tuple[int, int] = (0, 0)) -> None:
        """Add a folder, or change mode and owner (uid, gid) of an existing one.

        Raises ImageError if a parent is not a folder.
        """
        self._add(path, tarfile.DIRTYPE, mode, _nothing).uid, self._entries[_place(path)].head.gid = owner

    def link(self, path: str, target: str) -> None:
        """Add a symbolic link. Raises ImageError if a parent is not a folder."""
        self._add(path, tarfile.SYMTYPE, 0o777, _nothing).linkname = target

    def remove(self, patterns: Iterable[str]) -> None:
        """Remove all paths that match a pattern, and everything below them."""
        for pattern in patterns:
            for path in [*self.matching(pattern), *self.matching(f"{pattern}/*")]:
                self._entries.pop(path, None)

    def save(self, target: Path, epoch: int) -> None:
        """Write a tar in which all files have the same date. epoch: Unix seconds."""
        with tarfile.open(target, "w", format=tarfile.PAX_FORMAT) as archive:
            for path, entry in self:
                content = entry.content()
                head = _copied(entry.head)
                head.name, head.mtime, head.size = path, epoch, len(content)
                head.pax_headers = {
                    key: value for key, value in head.pax_headers.items() if key.startswith("SCHILY.xattr")
                }
                archive.addfile(head, io.BytesIO(content))

    def _add(self, path: str, kind: bytes, mode: int, content: Callable[[], bytes]) -> tarfile.TarInfo:
        place = _place(path)
        *above, _ = place.split("/")
        for count in range(1, len(above) + 1):
            folder = "/".join(above[:count])
            if folder not in self._entries:
                self._add(folder, tarfile.DIRTYPE, 0o755, _nothing)
            elif not self._entries[folder].head.isdir():
                raise ImageError(f"{path}: {folder} is not a folder in the image")
        head = tarfile.TarInfo(place)
        head.type, head.mode = kind, mode
        self._entries[place] = Entry(head, content)
        return head


def _place(path: str) -> str:
    place = path.removeprefix(".").strip("/")
    first, slash, rest = place.partition("/")
    return f"usr/{first}/{rest}" if slash and first in MERGED else place


def _copied(head: tarfile.TarInfo, kind: bytes | None = None) -> tarfile.TarInfo:
    made = tarfile.TarInfo(head.name)
    made.type, made.mode, made.linkname = kind or head.type, head.mode, "" if kind else head.linkname
    made.uid, made.gid, made.pax_headers = head.uid, head.gid, dict(head.pax_headers)
    return made


def _reader(archive: tarfile.TarFile, member: tarfile.TarInfo) -> Callable[[], bytes]:
    def read() -> bytes:
        file = archive.extractfile(member) if member.isreg() else None
        return file.read() if file else b""

    return read


def _nothing() -> bytes:
    return b""
