"""Terminal of 80 columns and 24 lines for tests, and comparison of what it shows with committed screens."""

import difflib
import io
import os
from contextlib import redirect_stderr, redirect_stdout, suppress
from pathlib import Path

import pyte

from firmware import cli

COLUMNS, LINES = 80, 24
SCREENS = Path(__file__).resolve().parent / "shown"
RENEW = "CAPTAIN_RENEW_SCREENS"
HOW = f"look at the difference; if it is wanted: {RENEW}=1 .venv/bin/python -m pytest tests/screens, and commit"


class Terminal(io.TextIOWrapper):
    """A stream that commands take for a terminal."""

    def __init__(self) -> None:
        super().__init__(io.BytesIO(), "utf-8", write_through=True)

    def getvalue(self) -> str:
        """Return all that was written."""
        written = self.buffer
        assert isinstance(written, io.BytesIO)
        return written.getvalue().decode()

    def isatty(self) -> bool:
        return True

    def run(self, *argv: str) -> None:
        """Run a command of captain on it."""
        with redirect_stdout(self), redirect_stderr(self), suppress(SystemExit):
            cli.main(list(argv))

    def lines(self) -> list[str]:
        """Lines shown, without the empty ones at the end."""
        shown = pyte.Screen(COLUMNS, LINES)
        stream = pyte.Stream(shown)
        stream.feed(self.getvalue().replace("\r\n", "\n").replace("\n", "\r\n"))
        lines = [line.rstrip() for line in shown.display]
        while lines and not lines[-1]:
            lines.pop()
        return lines


def compare(name: str, lines: list[str]) -> None:
    """Compare lines with the committed screen of this name; the first run of a new one writes it."""
    path = SCREENS / f"{name}.txt"
    if os.environ.get(RENEW):
        path.parent.mkdir(exist_ok=True)
        path.write_text("\n".join(lines) + "\n")
    committed = path.read_text().splitlines() if path.exists() else []
    difference = "\n".join(difflib.unified_diff(committed, lines, str(path), "shown now", lineterm=""))
    assert committed == lines, f"{difference}\n{HOW}"
    assert len(lines) <= LINES
    assert max(map(len, lines)) <= COLUMNS
