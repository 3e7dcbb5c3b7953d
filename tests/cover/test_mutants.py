"""Mistakes are made one by one, and told from each other by the tests of a small tree."""

from pathlib import Path

import pytest

from tests.cover.mutants import MISSED, NOT_EXECUTED, NOTICED, all_mutants, outcome_in

CODE = '''"""A text that no mistake empties."""


def is_more(one: "int", other: int) -> bool:
    """Whether it is."""
    if not one:
        log("a wording is left as it is", "key")
    return one > other


def log(*words: str) -> None:
    pass
'''
TESTS = """from code_of import is_more

def test_is_more_two_numbers_compares(): assert is_more(2, 1) and not is_more(1, 2)
"""


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    (tmp_path / "code_of.py").write_text(CODE)
    (tmp_path / "test_it.py").write_text(TESTS)
    return tmp_path


def test_mutants_small_file_are_told_by_line_and_change(tree: Path) -> None:
    assert [(mutant.line, mutant.what) for mutant in all_mutants(tree, ".") if mutant.path == "code_of.py"] == [
        (6, "the condition is turned"),
        (6, "not is left out"),
        (7, "the call is left out"),
        (7, "'key' is empty"),
        (8, "returns None"),
        (8, "Gt is GtE"),
    ]


@pytest.mark.parametrize(
    ("what", "tests", "outcome"),
    [
        ("returns None", ["test_it.py"], NOTICED),
        ("Gt is GtE", ["test_it.py"], MISSED),
        ("Gt is GtE", [], NOT_EXECUTED),
    ],
)
def test_outcome_mistake_and_tests_is_told_and_taken_back(
    tree: Path, what: str, tests: list[str], outcome: str
) -> None:
    (mutant,) = (mutant for mutant in all_mutants(tree, ".") if mutant.path == "code_of.py" and mutant.what == what)
    assert outcome_in(tree, mutant, tests) == outcome
    assert (tree / "code_of.py").read_text() == CODE
