import io

import pytest

from firmware.printable import folded
from tests.screens.terminal import Terminal

TEXT = "captain: replay: the first half of a line that is wider than a terminal\n  (" + "remedy " * 14 + ")"


@pytest.fixture(autouse=True)
def columns(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "40")


def test_text_for_a_file_is_not_folded() -> None:
    assert folded(TEXT, io.StringIO()) == TEXT


def test_text_for_a_terminal_is_folded_between_words_below_its_indent() -> None:
    assert folded(TEXT, Terminal()).split("\n") == [
        "captain: replay: the first half of a",
        "  line that is wider than a terminal",
        "  (remedy remedy remedy remedy remedy",
        "    remedy remedy remedy remedy remedy",
        "    remedy remedy remedy remedy )",
    ]


def test_path_wider_than_the_terminal_is_not_broken() -> None:
    path = "/a-folder" * 6
    assert folded(f"captain: {path}: no such file", Terminal()).split("\n")[1] == f"  {path}:"


@pytest.mark.parametrize("line", ["a" * 40, "two  spaces   stay", ""])
def test_line_that_fits_stays_as_it_is(line: str) -> None:
    assert folded(line, Terminal()) == line
