"""Parts of a test in new Debian roots: shows their rows beside the goals, and keeps them."""

import subprocess
import time
from collections.abc import Iterable, Iterator
from pathlib import Path

from image.errors import ImageError
from image.project import version
from tests.proof.image.rows import Row, keep


def show(parts: Iterable[tuple[str, Iterator[Row]]], results: Path) -> int:
    """Show and keep the rows of each part. Return the exit code: 1 if a row misses its goal, or without rows."""
    missed = total = 0
    for part, rows in parts:
        print(f"{part}:", flush=True)
        began, found = time.monotonic(), []
        for row in _ended(part, rows):
            print(row, flush=True)
            found.append(row)
        took = time.monotonic() - began
        print(f"        {took:.0f} s", flush=True)
        keep(results, part, version(), found, took)
        total, missed = total + len(found), missed + sum(not row.is_ok for row in found)
    print(f"{total - missed} of {total} meet their goal; rows: {results}")
    return 1 if missed or not total else 0


def _ended(part: str, rows: Iterator[Row]) -> Iterator[Row]:
    """Yield the rows; an error that ends them becomes a row, too."""
    try:
        yield from rows
    except (ImageError, OSError, subprocess.SubprocessError) as error:
        yield Row(f"{part} comes to its end", str(error), "its end", False)
