"""Progress of a long command on stderr.

On a terminal it is one updated line, otherwise a line per step.
"""

import sys
from typing import TextIO

WIDTH = 60  # columns; lines are padded to it, to overwrite the previous one


class Steps:
    """Counter of steps, with progress output. total: number of steps."""

    def __init__(self, total: int, stream: TextIO | None = None) -> None:
        self._stream = stream or sys.stderr
        self._total = total
        self._done = 0

    def __call__(self, what: str) -> None:
        """Begin a step, and print it."""
        self._done += 1
        line = f"[{self._done:{len(str(self._total))}}/{self._total}] {what}"
        if self._stream.isatty():
            print(f"\r{line[:WIDTH]:{WIDTH}}", end="", file=self._stream, flush=True)
        else:
            print(line, file=self._stream)

    def finish(self) -> None:
        """Clear the line of a terminal."""
        if self._stream.isatty():
            print("\r" + " " * WIDTH, end="\r", file=self._stream, flush=True)
