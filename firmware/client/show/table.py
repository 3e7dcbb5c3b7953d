"""Tables on a screen: redrawn in place on a terminal, plain lines elsewhere."""

import io
import os
import shutil
import signal
import sys
import textwrap
import time
from collections.abc import Iterable, Sequence
from contextlib import ExitStack, redirect_stderr, redirect_stdout, suppress
from types import FrameType, TracebackType
from typing import Any, NamedTuple, TextIO, TypeAlias

from firmware.printable import clean

GAP = "  "
INDENT = "  "
CUT = ".."  # ASCII, because the terminal's encoding is unknown
NARROWEST = 6
# Seconds, as of captain console: a terminal that others wrote to is right again.
RENEW_S = 10.0
# Control sequences of ECMA-48: SGR, and ED without parameters.
BOLD, PLAIN, REST_OF_SCREEN = "\x1b[1m", "\x1b[0m", "\x1b[J"


Line: TypeAlias = tuple[str, bool]  # text, and whether it is a title


class Table(NamedTuple):
    """Table of text.

    title  line above the table.
    heads  headings of the columns; `>` in front sets a column to the right, as for numbers.
    rows   cells, as many in each row as there are headings.
    notes  lines below the table.
    """

    title: str
    heads: Sequence[str] = ()
    rows: Sequence[Sequence[str]] = ()
    notes: Sequence[str] = ()


def plain(table: Table, width: int, cuts: bool = True) -> list[str]:
    """Return the lines of a table, folded to `width` columns.

    The widest columns are shortened until each row fits.

    cuts  False: keep all cells whole, however long a row becomes.
    """
    title = textwrap.wrap(clean(table.title.replace("\n", " ")), width, subsequent_indent=INDENT)
    notes = [line for note in table.notes for line in _folded(note, width)]
    if not table.rows:
        return title + notes
    lines = [
        [head.removeprefix(">") for head in table.heads],
        *([clean(cell) for cell in row] for row in table.rows),
    ]
    widths = [max(len(line[at]) for line in lines) for at in range(len(table.heads))]
    if cuts:
        widths = fit(widths, width, [max(NARROWEST, len(cell)) for cell in lines[0]])
    return title + [_line(line, widths, table.heads, width if cuts else sys.maxsize) for line in lines] + notes


def lines_for(table: Table, stream: TextIO) -> list[str]:
    """Return the lines of a table for a stream: within a terminal's width, but with whole cells for other programs."""
    return plain(table, width_of(stream), cuts=stream.isatty())


def _folded(note: str, width: int) -> list[str]:
    """Return a note folded to `width`; its own line breaks are kept, for example between the errors of a file."""
    first, *rest = note.split("\n")
    lines = textwrap.wrap(clean(first), width, initial_indent=INDENT, subsequent_indent=INDENT * 2)
    for line in rest:
        lines += textwrap.wrap(clean(line), width, initial_indent=INDENT * 2, subsequent_indent=INDENT * 2)
    return lines


def fit(widths: list[int], width: int, least: Sequence[int]) -> list[int]:
    """Return column widths that fit into `width` with their gaps, unless that needs one below its entry in `least`."""
    fitted = list(widths)
    while sum(fitted) + len(GAP) * (len(fitted) - 1) > width:
        wide = [at for at, (now, floor) in enumerate(zip(fitted, least, strict=True)) if now > floor]
        if not wide:
            break
        fitted[max(wide, key=lambda at: fitted[at])] -= 1
    return fitted


def _line(cells: Sequence[str], widths: Sequence[int], heads: Sequence[str], width: int) -> str:
    shown = (
        _cut(cell, room).rjust(room) if head.startswith(">") else _cut(cell, room).ljust(room)
        for cell, room, head in zip(cells, widths, heads, strict=True)
    )
    return GAP.join(shown).rstrip()[:width]


def _cut(cell: str, room: int) -> str:
    return cell if len(cell) <= room else cell[: room - len(CUT)] + CUT


def span(seconds: float) -> str:
    """Return a duration in at most six characters."""
    if seconds < 100:
        return f"{seconds:.0f} s" if seconds >= 10 else f"{seconds:.1f} s"
    if seconds < 6000:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.0f} h" if seconds < 360_000 else f"{seconds / 86400:.0f} d"


def counted(counts: Iterable[tuple[float, str]]) -> str:
    """Return counts with the names of what they count, singular or plural: `1 jump, 2 bringups`.

    Zero counts are omitted.
    """
    return ", ".join(f"{count:.0f} {name.removesuffix('s') if count == 1 else name}" for count, name in counts if count)


def times(count: float) -> str:
    """Return a count as text: "once" for 1, "2 times" for 2."""
    return "once" if count == 1 else f"{count:.0f} times"


def width_of(stream: TextIO) -> int:
    """Return the columns of the terminal; 80 if the stream is not a terminal."""
    return shutil.get_terminal_size((80, 24)).columns if stream.isatty() else 80


def lines_of(stream: TextIO) -> int:
    """Return the lines of the terminal, less one for the prompt; unlimited if the stream is not a terminal."""
    return shutil.get_terminal_size((80, 24)).lines - 1 if stream.isatty() else sys.maxsize


class Screen:
    """Shows tables repeatedly. On a terminal, each frame replaces the previous one.

    A frame is one write, and only of lines that changed: nothing flickers. All lines are written again every RENEW_S
    and at another size, because others may write to the terminal. A process that was stopped goes on below the
    shell's lines. What else this process prints on the terminal meanwhile goes above the tables.

    all_by  command that shows the lines for which the terminal has no room.
    """

    def __init__(self, stream: TextIO | None = None, all_by: str = "") -> None:
        self._all_by = f": `{all_by}` has all" if all_by else ""
        self.stream = sys.stdout if stream is None else stream
        self.is_terminal = self.stream.isatty() and os.environ.get("TERM") != "dumb"
        self._bold = "" if os.environ.get("NO_COLOR") else BOLD
        self._shown: list[Line] = []
        self._above = ExitStack()
        self._size = (0, 0)
        self._renew_at = 0.0  # time.monotonic()
        self._before: Any = None

    def __enter__(self) -> "Screen":
        if self.is_terminal:
            for redirect, stream in ((redirect_stdout, sys.stdout), (redirect_stderr, sys.stderr)):
                self._above.callback((above := _Above(self, stream)).finish)
                self._above.enter_context(redirect(above))
            with suppress(ValueError):  # only the main thread may have signal handlers
                self._before = signal.signal(signal.SIGCONT, self._go_on)
                self._above.callback(signal.signal, signal.SIGCONT, self._before)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        self._above.close()
        if self._shown:
            self._write(f"\r{self._styled(self._shown.pop())}\n")  # overwrites a ^C that the terminal has echoed
            self._shown = []

    @property
    def height(self) -> int:
        """Number of lines that can be shown in place; unlimited without a terminal."""
        return lines_of(self.stream) if self.is_terminal else sys.maxsize

    def show(self, tables: Iterable[Table]) -> None:
        """Show tables one below the other; cut them to the terminal's width and height, but not for other programs."""
        blocks = [(table.title, lines_for(table, self.stream)) for table in tables]
        if not self.is_terminal:
            self._write("\n\n".join("\n".join(lines) for _, lines in blocks) + "\n\n")
            return
        lines = [(line, title != "" and at == 0) for title, block in blocks for at, line in enumerate([*block, ""])]
        while lines and not lines[-1][0]:
            lines.pop()
        if (more := len(lines) - self.height) > 0:
            lines[self.height - 1 :] = [(f"{more + 1} lines more{self._all_by}", False)]
        self._paint(lines)

    def _paint(self, lines: list[Line]) -> None:
        size, now = shutil.get_terminal_size(), time.monotonic()
        is_kept = size == self._size and now < self._renew_at and len(self._shown) <= len(lines)
        if not is_kept:
            self._size, self._renew_at = size, now + RENEW_S
        before = self._shown if is_kept else []
        start = _to_top(self._shown) + ("" if before else REST_OF_SCREEN)
        rows = []
        for at, line in enumerate(lines):
            old = before[at] if at < len(before) else ("", False)
            rows.append("" if line == old else self._styled(line, len(old[0])))
        self._shown = lines
        self._write(start + "\r\n".join(rows) + "\r")

    def _styled(self, line: Line, room: int = 0) -> str:
        """Return a line with its style, padded with spaces to cover the line shown before.

        EL is not used: at the last column, some terminals would erase the last character.
        """
        text, is_title = line
        shown = text.ljust(room)
        return f"{self._bold}{shown}{PLAIN}" if self._bold and is_title else shown

    def _go_on(self, number: int, frame: FrameType | None) -> None:
        """Mark the terminal's content as unknown, because the shell has printed on it since the last frame."""
        self._shown = []
        if callable(self._before):
            self._before(number, frame)

    def print_above(self, stream: TextIO, text: str) -> None:
        """Print whole lines in place of the tables; the next show() draws the tables below them."""
        before, self._shown = self._shown, []
        if before:
            self._write(_to_top(before) + REST_OF_SCREEN)
        stream.write(text)
        stream.flush()

    def _write(self, text: str) -> None:
        self.stream.write(text)
        self.stream.flush()


def _to_top(shown: Sequence[Line]) -> str:
    """Return the control sequence that moves the cursor from the last shown line to the first."""
    return f"\r\x1b[{len(shown) - 1}A" if len(shown) > 1 else "\r"


class _Above(io.TextIOBase):
    """Output stream of this process while a screen is shown: prints whole lines above the tables."""

    def __init__(self, screen: Screen, stream: TextIO) -> None:
        self._screen = screen
        self._stream = stream
        self._begun = ""

    def write(self, text: str) -> int:
        if not self._stream.isatty():
            return self._stream.write(text)
        whole, newline, self._begun = (self._begun + text).rpartition("\n")
        if newline:
            self._screen.print_above(self._stream, whole + newline)
        return len(text)

    def finish(self) -> None:
        """Print the last line, even if its end is missing."""
        if self._begun:
            self._screen.print_above(self._stream, f"{self._begun}\n")
            self._begun = ""

    def flush(self) -> None:
        self._stream.flush()

    def isatty(self) -> bool:
        return self._stream.isatty()

    def fileno(self) -> int:
        return self._stream.fileno()
