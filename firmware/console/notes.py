"""Lines of a file that are shown above everything: what the start had to say, such as mistakes in a user's files."""

import os
from pathlib import Path

MOST = 16_384  # octets of the file that are shown
MOST_LINES = 100


class Notes:
    """The lines of a file, read again when it is another one. A file that is not there has none.

    lines  without those that are empty; text of others, which may hold anything.
    """

    def __init__(self, path: str) -> None:
        self.lines: list[str] = []
        self._path = Path(path) if path else None
        self._seen: tuple[int, ...] | None = None

    def look(self) -> None:
        """Read it where it has changed."""
        if self._path is None:
            return
        try:
            found = os.stat(self._path)
            seen = (found.st_ino, found.st_mtime_ns, found.st_size)
            if seen != self._seen:
                self.lines = _lines(self._path)
                self._seen = seen
        except FileNotFoundError:
            self.lines, self._seen = [], None
        except OSError as error:
            self.lines, self._seen = [f"{self._path}: cannot be read: {error.strerror}"], None


def _lines(path: Path) -> list[str]:
    """Of a regular file: a pipe would be waited for. Raises OSError."""
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    with os.fdopen(descriptor, "rb") as file:
        octets = file.read(MOST + 1) or b""
    lines = [line.rstrip() for line in octets[:MOST].decode("utf-8", "replace").splitlines()]
    lines = [line for line in lines if line]
    is_more = len(octets) > MOST or len(lines) > MOST_LINES
    return [*lines[:MOST_LINES], *([f"... {path} has more"] if is_more else [])]
