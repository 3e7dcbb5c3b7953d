"""Notes of the start: a file whose lines the serial console shows above everything."""

import os
from pathlib import Path

MOST_OCTETS = 16_384  # octets of the file that are read
MOST_LINES = 100


class Notes:
    """Lines of a file with notes of the start, such as mistakes in the owner's files; shown above everything.

    The file is read again when it has changed. An absent file has no lines.

    lines  non-empty lines; their text comes from other programs and may contain anything.
    """

    def __init__(self, path: str) -> None:
        self.lines: list[str] = []
        self._path = Path(path) if path else None
        self._seen: tuple[int, ...] | None = None

    def look(self) -> None:
        """Read the file if it has changed."""
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
    """Return the first lines of a file, without waiting for a pipe. Raises OSError if it cannot be read."""
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    with os.fdopen(descriptor, "rb") as file:
        octets = file.read(MOST_OCTETS + 1) or b""
    lines = [line.rstrip() for line in octets[:MOST_OCTETS].decode("utf-8", "replace").splitlines()]
    lines = [line for line in lines if line]
    is_more = len(octets) > MOST_OCTETS or len(lines) > MOST_LINES
    return [*lines[:MOST_LINES], *([f"... {path} has more"] if is_more else [])]
