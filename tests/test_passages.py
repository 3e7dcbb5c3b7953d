"""Passages: the draw has each kind, repeats itself by seed, and shows the code beside a text."""

from pathlib import Path

from tests.passages import comments, docstrings, drawn

SOURCE = '''"""Registry of drivers by their name."""

# Seconds that a reset takes, as measured.
RESET_S = 3.0


def find(name: str) -> int:
    """Return the row of a driver."""
    return len(name)  # one for each letter
'''


def test_passages_of_code_are_shown_with_what_stands_beside_them() -> None:
    assert [(one.beside, one.text) for one in docstrings("drivers/a.py", SOURCE)] == [
        ("module", "Registry of drivers by their name."),
        ("def find(name: str) -> int", "Return the row of a driver."),
    ]
    assert [one.beside for one in comments("drivers/a.py", SOURCE)] == ["RESET_S = 3.0", "return len(name)"]


def test_passages_of_one_seed_are_the_same_again(tmp_path: Path) -> None:
    (tmp_path / "drivers").mkdir()
    (tmp_path / "drivers/a.py").write_text(SOURCE)
    (tmp_path / "README.md").write_text("One two three four five six.\n\nSeven eight nine ten eleven twelve.\n")
    first = drawn(tmp_path, 4, 7, ("",))
    assert first == drawn(tmp_path, 4, 7, ("",))
    assert [kind for kind, _ in first] == ["docstring", "comment", "guide"]
