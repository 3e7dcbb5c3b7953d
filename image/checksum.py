"""SHA-256 of files, in the form that sha256sum writes and checks."""

import hashlib
from collections.abc import Iterable
from pathlib import Path


def sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def sums(paths: Iterable[Path]) -> str:
    """A line for each, with the name alone: they lie in one folder."""
    return "".join(f"{sha256(path)}  {path.name}\n" for path in paths)
