"""How far a long command is, on standard error: one line that changes on a terminal, one line a step elsewhere."""

import sys
from typing import TextIO

WIDTH = 60  # columns: what was there before is overwritten


class Steps:
    """Counted steps; total: how many there will be."""

    def __init__(self, total: int, stream: TextIO | None = None) -> None:
        self._stream = stream or sys.stderr
        self._total = total
        self._done = 0

    def __call__(self, what: str) -> None:
        """A step begins."""
        self._done += 1
        line = f"[{self._done:{len(str(self._total))}}/{self._total}] {what}"
        if self._stream.isatty():
            print(f"\r{line[:WIDTH]:{WIDTH}}", end="", file=self._stream, flush=True)
        else:
            print(line, file=self._stream)

    def finish(self) -> None:
        """Leave a clean line for what comes next."""
        if self._stream.isatty():
            print("\r" + " " * WIDTH, end="\r", file=self._stream, flush=True)
