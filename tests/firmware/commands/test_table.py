import io

from hypothesis import given
from hypothesis import strategies as st

from firmware.user.table import Screen, Table, counted, fit, plain, times


def test_numbers_stand_right_and_words_left():
    table = Table("title", ("name", ">count"), [("a", "1"), ("longer", "100")])
    assert plain(table, 80) == ["title", "name    count", "a           1", "longer    100"]


def test_the_widest_column_gives_way_and_shows_that_it_did():
    table = Table("", ("a", "b"), [("x" * 50, "short")])
    assert plain(table, 20)[1] == "x" * 11 + "..  short"


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
    assert all(after <= before for after, before in zip(fit(widths, width), widths, strict=True))


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_a_terminal_shows_one_table_in_place_of_the_other(monkeypatch):
    monkeypatch.setenv("TERM", "xterm")
    out = Terminal()
    with Screen(out) as screen:
        screen.show([Table("first")])
        screen.show([Table("second")])
    assert "\x1b[1A" in out.getvalue() or "\x1b[2K" in out.getvalue()
    assert "second" in out.getvalue()


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
