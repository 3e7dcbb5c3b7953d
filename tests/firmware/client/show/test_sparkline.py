"""Sparkline: marks of values, and those that a terminal has."""

import io
import math

import pytest

from firmware.client.show.sparkline import BLOCKS, LETTERS, marks_for, sparkline


@pytest.mark.parametrize(
    ("values", "width", "line"),
    [
        ([], 8, ""),
        ([math.nan, math.nan], 8, ""),
        ([5.0], 8, "+"),
        ([5.0, 5.0, 5.0], 8, "+++"),
        ([0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0], 8, "_.-=+*%#"),
        ([0.0, math.nan, 7.0], 8, "_ #"),
        ([0.0, 0.0, 7.0, 7.0], 2, "_#"),
        ([0.0, math.nan, 7.0, 7.0], 2, "_#"),
        ([-3e9, 3e9], 80, "_#"),
    ],
)
def test_sparkline_shows_a_part_of_the_values_as_a_mark_of_their_mean(
    values: list[float], width: int, line: str
) -> None:
    assert sparkline(values, width) == line


def test_sparkline_is_never_wider_than_asked_for() -> None:
    for count in range(1, 300):
        assert len(sparkline([float(value) for value in range(count)], 60)) == min(60, count)


class Terminal(io.StringIO):
    def __init__(self, encoding: str, is_terminal: bool) -> None:
        super().__init__()
        self._encoding = encoding
        self._is_terminal = is_terminal

    @property
    def encoding(self) -> str:  # type: ignore[override]
        return self._encoding

    def isatty(self) -> bool:
        return self._is_terminal


@pytest.mark.parametrize(
    ("encoding", "is_terminal", "term", "marks"),
    [
        ("utf-8", True, "xterm-256color", BLOCKS),
        ("UTF8", True, "linux", BLOCKS),
        ("utf-8", False, "", BLOCKS),
        ("utf-8", True, "vt102", LETTERS),
        ("ascii", True, "xterm", LETTERS),
        ("ascii", False, "xterm", LETTERS),
    ],
)
def test_marks_of_a_terminal_are_those_that_it_has(
    monkeypatch: pytest.MonkeyPatch, encoding: str, is_terminal: bool, term: str, marks: str
) -> None:
    monkeypatch.setenv("TERM", term)
    assert marks_for(Terminal(encoding, is_terminal)) == marks
