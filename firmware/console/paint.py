"""Lines to octets: in place with what each VT100 has, or below one another for a terminal that has nothing."""

from collections.abc import Sequence

# ECMA-48: CUP without parameters, EL and ED without parameters. Nothing else is sent.
HOME, REST_OF_LINE, REST_OF_SCREEN = b"\x1b[H", b"\x1b[K", b"\x1b[J"
LINE_END = b"\r\n"


class Painter:
    """Octets that make a screen show lines; the cursor rests behind the last.

    Only what changed is sent. Lines in between are passed with line feeds from the upper left corner, which every
    terminal has, whatever it takes for a column.
    """

    def __init__(self) -> None:
        self._shown: list[str] = []

    def forget(self) -> None:
        """Somebody else has written on the screen: the next frame is whole."""
        self._shown = []

    def frame(self, lines: Sequence[str]) -> bytes:
        """ASCII lines, one at least; nothing when all of them are shown already."""
        before, self._shown = self._shown, list(lines)
        if before == self._shown:
            return b""
        if len(before) != len(lines):
            return HOME + LINE_END.join(_line(line) for line in lines) + REST_OF_SCREEN
        rows = (b"\n" if line == old else _line(line) + LINE_END for line, old in zip(lines[:-1], before, strict=False))
        return HOME + b"".join(rows) + _line(lines[-1])


class Printer:
    """The same for a terminal that prints: each frame below the one before, without a single escape code."""

    def forget(self) -> None: ...

    def frame(self, lines: Sequence[str]) -> bytes:
        return LINE_END + LINE_END.join(line.encode("ascii") for line in lines)


def _line(line: str) -> bytes:
    return line.encode("ascii") + REST_OF_LINE
