"""Sections on pages: nothing is lost, nothing is twice, nothing is longer than a page."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from firmware.console.pages import pages, screen


@given(lengths=st.lists(st.integers(1, 50), max_size=8), height=st.integers(1, 25))
def test_every_line_is_on_one_page_in_its_order(lengths: list[int], height: int) -> None:
    sections = [[f"{at}.{line}" for line in range(length)] for at, length in enumerate(lengths)]
    made = pages(sections, height)
    assert [line for page in made for line in page] == [line for section in sections for line in section]
    assert all(len(page) <= height for page in made)
    assert all(made) or not sections


def test_a_section_does_not_begin_with_two_lines_at_the_end_of_a_page() -> None:
    assert pages([["a"] * 8, ["head", "1", "2", "3"]], 10) == [["a"] * 8, ["head", "1", "2", "3"]]
    assert pages([["a"] * 8, ["head", "1"]], 10) == [["a"] * 8 + ["head", "1"]]


@pytest.mark.parametrize("height", range(1, 25))
def test_a_screen_is_as_high_as_the_terminal_and_ends_with_the_keys(height: int) -> None:
    for body in ([], ["line"], ["line"] * 50):
        lines = screen("head", body, "message", "keys", height)
        assert len(lines) == height
        assert lines[-1] == "keys"
        assert height < 3 or lines[0] == "head"
