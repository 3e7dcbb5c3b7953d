import io
import re
import signal
import sys
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from firmware.client.show.table import Screen, Table, counted, fit, plain, times
from tests.screens.terminal import Terminal


def test_numbers_stand_right_and_words_left():
    table = Table("title", ("name", ">count"), [("a", "1"), ("longer", "100")])
    assert plain(table, 80) == ["title", "name    count", "a           1", "longer    100"]


def test_the_widest_column_gives_way_and_shows_that_it_did():
    table = Table("", ("a", "b"), [("x" * 50, "short")])
    assert plain(table, 20)[1] == "x" * 11 + "..  short"


def test_a_heading_stays_whole_where_its_column_gives_way():
    rows = [("x" * 50, "y" * 50, "z" * 50)]
    heading, cells = plain(Table("", ("signal strength", "says", ">how long ago"), rows), 44)
    assert heading == "signal strength  says           how long ago"
    assert cells == "x" * 13 + "..  " + "y" * 10 + "..  " + "z" * 11 + ".."


def test_where_nothing_gives_way_cells_are_whole():
    table = Table("", ("a", "b"), [("x" * 50, "short")])
    assert plain(table, 20, cuts=False)[1] == "x" * 50 + "  short"


def test_a_table_without_rows_is_its_title_and_notes():
    assert plain(Table("nothing", ("a",), (), ["why"]), 80) == ["nothing", "  why"]


def test_long_notes_are_folded():
    assert plain(Table("", (), (), ["one two three"]), 10) == ["  one two", "    three"]


@given(
    st.lists(st.tuples(st.text(), st.text(), st.text()), max_size=5),
    st.text(),
    st.lists(st.text(), max_size=2),
    st.integers(30, 200),
)
def test_no_cell_breaks_a_line_or_obeys_a_peer(rows, title, notes, width):
    lines = plain(Table(title, ("a", ">b", "c"), rows, notes), width)
    assert all(len(line) <= width for line in lines)
    assert all(line.isprintable() for line in lines)


@given(st.lists(st.integers(1, 300), min_size=1, max_size=8), st.integers(1, 300))
def test_columns_never_grow(widths, width):
    assert all(after <= before for after, before in zip(fit(widths, width, [6] * len(widths)), widths, strict=True))


@pytest.fixture
def terminal(monkeypatch):
    for name, value in (("TERM", "xterm"), ("LINES", "24"), ("COLUMNS", "80")):
        monkeypatch.setenv(name, value)
    monkeypatch.delenv("NO_COLOR", raising=False)
    return Terminal()


def test_a_terminal_shows_one_table_in_place_of_the_other(terminal):
    with Screen(terminal) as screen:
        screen.show([Table("first", ("n",), [("1",), ("2",)])])
        screen.show([Table("second", ("n",), [("1",), ("3",), ("4",)])])
        screen.show([Table("third")])
    assert [line for line in terminal.lines() if line] == ["third"]


def test_a_frame_is_one_write_of_the_lines_that_changed(terminal, monkeypatch):
    written = []
    with Screen(terminal) as screen:
        screen.show([Table("title", ("n",), [("first",), ("second",)])])
        monkeypatch.setattr(terminal, "write", written.append)
        screen.show([Table("title", ("n",), [("first",), ("2nd",)])])
        screen.show([Table("title", ("n",), [("first",), ("2nd",)])])
        monkeypatch.undo()
    assert len(written) == 2
    assert "2nd   " in written[0]
    assert not any("title" in text or "first" in text or "\x1b[J" in text for text in written)
    assert "2nd" not in written[1]


def test_screen_after_the_process_was_stopped_goes_on_below_the_shell(terminal):
    with Screen(terminal) as screen:
        screen.show([Table("title", ("n",), [("1",)])])
        terminal.write("\r\n\n\n$ fg\r\n")
        signal.raise_signal(signal.SIGCONT)
        screen.show([Table("title", ("n",), [("1",)])])
    assert [line for line in terminal.lines() if line][-4:] == ["$ fg", "title", "n", "1"]


@pytest.mark.parametrize("change", ["time", "size"])
def test_screen_after_a_while_and_at_another_size_is_written_as_a_whole(terminal, monkeypatch, change):
    with Screen(terminal) as screen:
        screen.show([Table("title", ("n",), [("1",)])])
        terminal.write("a stray text\r")
        if change == "time":
            now = time.monotonic() + 11.0
            monkeypatch.setattr("firmware.client.show.table.time.monotonic", lambda: now)
        else:
            monkeypatch.setenv("COLUMNS", "70")
        screen.show([Table("title", ("n",), [("1",)])])
    assert terminal.lines()[:3] == ["title", "n", "1"]


def test_screen_at_its_end_prints_a_begun_line(terminal, monkeypatch):
    monkeypatch.setattr("sys.stderr", terminal)
    with Screen(terminal):
        print("no end of line", end="", file=sys.stderr)
    assert terminal.lines()[0] == "no end of line"


def test_a_line_of_80_columns_is_whole(terminal):
    with Screen(terminal) as screen:
        for letter in "ab":
            screen.show([Table("", ("n",), [(letter * 80,), (letter * 80,)])])
    assert terminal.lines()[:3] == ["n", "b" * 80, "b" * 80]


def test_what_is_printed_meanwhile_goes_above_the_tables(terminal, monkeypatch):
    monkeypatch.setattr("sys.stderr", terminal)
    with Screen(terminal) as screen:
        screen.show([Table("title", ("n",), [("1",)])])
        print("captain: a ", end="", file=sys.stderr)
        print("note", file=sys.stderr)
        screen.show([Table("title", ("n",), [("2",)])])
    assert [line for line in terminal.lines() if line] == ["captain: a note", "title", "n", "2"]


def test_a_table_stays_whole_where_the_terminal_has_echoed_a_key(terminal):
    with Screen(terminal) as screen:
        screen.show([Table("title", ("n",), [("last",)])])
        terminal.write("^C")
    assert terminal.lines()[:3] == ["title", "n", "last"]


@pytest.mark.parametrize("value", ["1", "anything"])
def test_with_no_color_nothing_is_bold(terminal, monkeypatch, value):
    with Screen(terminal) as screen:
        screen.show([Table("title")])
    assert "\x1b[1mtitle" in terminal.getvalue()
    monkeypatch.setenv("NO_COLOR", value)
    with Screen(plainly := Terminal()) as screen:
        screen.show([Table("title")])
    assert "title" in plainly.getvalue()
    assert not re.search(r"\x1b\[[0-9;]*m", plainly.getvalue())


def test_a_table_higher_than_the_terminal_is_cut(monkeypatch):
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("LINES", "10")
    monkeypatch.setenv("COLUMNS", "80")
    out = Terminal()
    with Screen(out, "captain status | less") as screen:
        screen.show([Table("above"), Table("", ("n",), [(f"row {n}",) for n in range(50)])])
    assert "row 4" in out.getvalue()
    assert "row 5" not in out.getvalue()
    assert "45 lines more: `captain status | less` has all" in out.getvalue()


def test_a_table_as_high_as_the_terminal_is_whole(monkeypatch):
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("LINES", "10")
    monkeypatch.setenv("COLUMNS", "80")
    out = Terminal()
    with Screen(out) as screen:
        screen.show([Table("", ("n",), [(f"row {n}",) for n in range(8)])])
    assert "row 7" in out.getvalue()
    assert "more" not in out.getvalue()


def test_elsewhere_each_table_is_plain_lines():
    out = io.StringIO()
    with Screen(out) as screen:
        screen.show([Table("one"), Table("two")])
        screen.show([Table("three")])
    assert out.getvalue() == "one\n\ntwo\n\nthree\n\n"


def test_a_terminal_that_cannot_move_its_cursor_gets_plain_lines(monkeypatch):
    monkeypatch.setenv("TERM", "dumb")
    out = Terminal()
    with Screen(out) as screen:
        screen.show([Table("one")])
    assert out.getvalue() == "one\n\n"


def test_one_of_something_is_not_told_as_several():
    assert counted([(1, "jumps"), (0, "bringups"), (2, "resets")]) == "1 jump, 2 resets"
    assert (times(1), times(2)) == ("once", "2 times")


def test_several_lines_of_a_note_are_as_many_on_the_screen():
    table = Table("title of\nno two lines", notes=["v2n: a.toml: foo\nb.toml: bar\x1b[2J"])
    assert plain(table, 80) == ["title of no two lines", "  v2n: a.toml: foo", "    b.toml: bar\\x1b[2J"]
