"""Reads an ext4 inside an image with debugfs, without mounting."""

import re
import tempfile
from pathlib import Path

from image.errors import ImageError
from image.tool import run

SMALL = 65_536  # octets


class FileSystem:
    """File system at an offset of an image; a context manager. tools: folder of an unpacked e2fsprogs."""

    def __init__(self, image: Path, offset: int, tools: Path) -> None:
        self._device = f"{image}?offset={offset}"
        self._tools = tools
        self._sizes: dict[str, int] = {}
        self._modes: dict[str, int] = {}
        self._folder = tempfile.TemporaryDirectory()

    def __enter__(self) -> "FileSystem":
        return self

    def __exit__(self, *_: object) -> None:
        self._folder.cleanup()

    def paths(self) -> list[str]:
        """Return the paths of all files and folders."""
        if not self._modes:
            self._list([""])
        return list(self._modes)

    def mode(self, path: str) -> int:
        return self._modes[path]

    def size(self, path: str) -> int:
        """Return the octets of a file; 0 for folders and links."""
        return self._sizes[path] if self._modes[path] & 0o170000 == 0o100000 else 0

    def target(self, path: str) -> str:
        """Return the target of a symbolic link."""
        said = self._debugfs(f'stat "/{path}"')
        found = re.search('^Fast link dest: "(.*)"$', said, re.MULTILINE)
        return found[1] if found else self.read(path).decode()

    def is_small(self, path: str) -> bool:
        """Return whether a path is a file small enough to be read completely."""
        return self._modes[path] & 0o170000 == 0o100000 and self._sizes[path] <= SMALL

    def read(self, path: str) -> bytes:
        """Return the content of a file. Raises ImageError if it is absent."""
        target = Path(self._folder.name) / "file"
        target.unlink(missing_ok=True)
        self._debugfs(f'dump "/{path}" {target}')
        if not target.exists():
            raise ImageError(f"{path}: is not in the file system")
        return target.read_bytes()

    def owner(self, offset: int) -> str:
        """Return the path of the file that contains an octet of the file system."""
        said = self._debugfs(f"icheck {offset // 4096}").splitlines()[-1].split()
        if len(said) < 2 or not said[1].isdecimal():
            return "in no file"
        return self._debugfs(f"ncheck {said[1]}").splitlines()[-1].split("\t")[-1]

    def _list(self, folders: list[str]) -> None:
        """List folders and all folders in them, one level per run of debugfs."""
        while folders:
            said = self._debugfs("\n".join(f'ls -p "/{folder}"' for folder in folders))
            below: list[str] = []
            for folder, part in zip(folders, said.split("debugfs: ls -p")[1:], strict=True):
                for _, mode, _, _, name, size in re.findall(
                    r"^/(\d+)/(\d+)/(\d+)/(\d+)/([^/]+)/(\d*)/", part, re.MULTILINE
                ):
                    if name in (".", "..", "lost+found"):
                        continue
                    path = f"{folder}/{name}".lstrip("/")
                    self._modes[path], self._sizes[path] = int(mode, 8), int(size or 0)
                    if int(mode, 8) & 0o170000 == 0o040000:
                        below.append(path)
            folders = below

    def _debugfs(self, commands: str) -> str:
        loader = next(self._tools.glob("usr/lib/*/ld-linux*.so.*"))
        program: list[str | Path] = [loader, "--library-path", loader.parent, self._tools / "usr/sbin/debugfs"]
        return run([*program, "-f", "-", self._device], given=commands + "\n")
