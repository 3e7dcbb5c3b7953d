"""Draws lines on a terminal: in place on a VT100, else below."""

from collections.abc import Sequence

# ECMA-48: CUP, EL and ED, all without parameters. No other codes are sent.
HOME, REST_OF_LINE, REST_OF_SCREEN = b"\x1b[H", b"\x1b[K", b"\x1b[J"
LINE_END = b"\r\n"


class Painter:
    """Converts lines to octets that show them on the screen; the cursor stays after the last line.

    Only changed lines are sent. Line feeds from the upper left corner skip the others, because they work on every
    terminal, whatever its width.
    """

    def __init__(self) -> None:
        self._shown: list[str] = []

    def forget(self) -> None:
        """Make the next frame complete, because other output has changed the screen."""
        self._shown = []

    def frame(self, lines: Sequence[str]) -> bytes:
        """Return the octets for ASCII lines, at least one; empty if all are shown already."""
        before, self._shown = self._shown, list(lines)
        if before == self._shown:
            return b""
        if len(before) != len(lines):
            return HOME + LINE_END.join(_line(line) for line in lines) + REST_OF_SCREEN
        rows = (b"\n" if line == old else _line(line) + LINE_END for line, old in zip(lines[:-1], before, strict=False))
        return HOME + b"".join(rows) + _line(lines[-1])


class Printer:
    """Painter for printing terminals: each frame below the previous one, without escape codes."""

    def forget(self) -> None: ...

    def frame(self, lines: Sequence[str]) -> bytes:
        return LINE_END + LINE_END.join(line.encode("ascii") for line in lines)


def _line(line: str) -> bytes:
    return line.encode("ascii") + REST_OF_LINE
