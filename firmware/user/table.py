"""Tables on a screen: in place by rich on a terminal, as plain lines without escape codes everywhere else."""

import os
import shutil
import sys
import textwrap
from collections.abc import Iterable, Sequence
from types import TracebackType
from typing import TYPE_CHECKING, NamedTuple, TextIO

from firmware.printable import clean

if TYPE_CHECKING:
    from rich.live import Live

GAP = "  "
INDENT = "  "
CUT = ".."  # ASCII: the terminal's encoding may be anything
NARROWEST = 6


class Table(NamedTuple):
    """A title, the columns' heads (`>` in front: numbers, set to the right), rows of as many cells, notes."""

    title: str
    heads: Sequence[str] = ()
    rows: Sequence[Sequence[str]] = ()
    notes: Sequence[str] = ()


def plain(table: Table, width: int, cuts: bool = True) -> list[str]:
    """The lines of a table, none longer than width; the widest columns give way, other text is folded.

    cuts  False: rows are as long as what is in them.
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
        widths = fit(widths, width)
    return title + [_line(line, widths, table.heads, width if cuts else sys.maxsize) for line in lines] + notes


def lines_for(table: Table, stream: TextIO) -> list[str]:
    """Its lines on a stream: within the width of a terminal; uncut for what is read by another program."""
    return plain(table, width_of(stream), cuts=stream.isatty())


def _folded(note: str, width: int) -> list[str]:
    """A note; what has several lines, such as the mistakes of a file, keeps them."""
    first, *rest = note.split("\n")
    lines = textwrap.wrap(clean(first), width, initial_indent=INDENT, subsequent_indent=INDENT * 2)
    for line in rest:
        lines += textwrap.wrap(clean(line), width, initial_indent=INDENT * 2, subsequent_indent=INDENT * 2)
    return lines


def fit(widths: list[int], width: int) -> list[int]:
    """Column widths that together with their gaps fit into width, as far as NARROWEST allows."""
    fitted = list(widths)
    while sum(fitted) + len(GAP) * (len(fitted) - 1) > width and max(fitted) > NARROWEST:
        fitted[fitted.index(max(fitted))] -= 1
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
    """A time span in at most six characters."""
    if seconds < 100:
        return f"{seconds:.0f} s" if seconds >= 10 else f"{seconds:.1f} s"
    if seconds < 6000:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.0f} h" if seconds < 360_000 else f"{seconds / 86400:.0f} d"


def counted(counts: Iterable[tuple[float, str]]) -> str:
    """Counts with what is counted, in its plural: `1 jump, 2 bringups`. What is none is left out."""
    return ", ".join(f"{count:.0f} {name.removesuffix('s') if count == 1 else name}" for count, name in counts if count)


def times(count: float) -> str:
    """How often: once, 2 times."""
    return "once" if count == 1 else f"{count:.0f} times"


def width_of(stream: TextIO) -> int:
    """Columns of the terminal; 80 where there is none."""
    return shutil.get_terminal_size((80, 24)).columns if stream.isatty() else 80


def lines_of(stream: TextIO) -> int:
    """Lines of the terminal above the next prompt; without one there is no end."""
    return shutil.get_terminal_size((80, 24)).lines - 1 if stream.isatty() else sys.maxsize


class Screen:
    """Shows tables again and again. On a terminal each takes the place of the one before.

    all_by  the command that shows what a terminal has no room for.
    """

    def __init__(self, stream: TextIO | None = None, all_by: str = "") -> None:
        self._all_by = f": `{all_by}` has all" if all_by else ""
        self.stream = sys.stdout if stream is None else stream
        self.is_terminal = self.stream.isatty() and os.environ.get("TERM") != "dumb"
        self._live: Live | None = None

    def __enter__(self) -> "Screen":
        if self.is_terminal:
            from rich.console import Console
            from rich.live import Live

            self._live = Live(console=Console(file=self.stream), auto_refresh=False)
            self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        if self._live is not None:
            self._live.stop()

    @property
    def height(self) -> int:
        """Lines that can be shown in place; where nothing is, there is no end."""
        return lines_of(self.stream) if self.is_terminal else sys.maxsize

    def show(self, tables: Iterable[Table]) -> None:
        """Show tables one below the other; what is read by another program than a terminal is not cut."""
        blocks = [(table.title, lines_for(table, self.stream)) for table in tables]
        if self._live is None:
            self.stream.write("\n\n".join("\n".join(lines) for _, lines in blocks) + "\n\n")
            self.stream.flush()
            return
        from rich.text import Text

        text = Text(no_wrap=True, overflow="crop")
        lines = [(line, title and at == 0) for title, block in blocks for at, line in enumerate([*block, ""])][:-1]
        if (more := len(lines) - self.height) > 0:
            lines[self.height - 1 :] = [(f"{more + 1} lines more{self._all_by}", "")]
        for line, is_title in lines:
            text.append(line + "\n", style="bold" if is_title else "")
        text.rstrip()
        self._live.update(text, refresh=True)
