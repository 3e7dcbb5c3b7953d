"""SHA-256 checksums of files, in the format of sha256sum."""

import hashlib
from collections.abc import Iterable
from pathlib import Path


def sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def sums(paths: Iterable[Path]) -> str:
    """Return a line per file, with the name only, because the files lie in one folder."""
    return "".join(f"{sha256(path)}  {path.name}\n" for path in paths)
