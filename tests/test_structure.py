"""Goals of tests/structure.py, on small trees."""

from pathlib import Path

import pytest

from tests.structure import MOST_FILES, OURS, main


@pytest.fixture
def root(tmp_path: Path) -> Path:
    for name in OURS:
        (tmp_path / name).mkdir()
    return tmp_path


@pytest.fixture
def run(root: Path, monkeypatch: pytest.MonkeyPatch):
    def run(*words: str) -> int:
        monkeypatch.setattr("sys.argv", ["structure", *words, str(root)])
        return main()

    return run


def fill(folder: Path, count: int) -> None:
    folder.mkdir(exist_ok=True)
    for number in range(count):
        (folder / f"part{number}.py").write_text("")


def test_structure_at_its_goals_exits_with_0(root, run, capsys):
    fill(root / "board", MOST_FILES)
    assert run() == 0
    assert "MISSED" not in capsys.readouterr().out


def test_structure_with_a_too_full_folder_exits_with_1_and_names_its_files(root, run, capsys):
    fill(root / "board", MOST_FILES + 1)
    assert run("--names") == 1
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[2] for line in lines if "MISSED" in line] == ["board/"]
    (names,) = [line for line in lines if line.startswith("too full: board: part0.py, ")]
    assert names.count(".py") == MOST_FILES + 1


def test_structure_of_a_list_has_no_goal(root, run, capsys):
    fill(root / "board" / "runtime", MOST_FILES + 1)
    assert run() == 0
    assert "a list" in capsys.readouterr().out


def test_structure_with_a_cycle_of_imports_exits_with_1(root, run, capsys):
    (root / "board" / "a.py").write_text("import board.b")
    (root / "board" / "b.py").write_text("import board.a")
    assert run() == 1
    missed = [line for line in capsys.readouterr().out.splitlines() if "MISSED" in line]
    assert [line[:24] for line in missed] == ["cycles of imports at loa", "cycles with imports in f"]


def test_structure_names_packages_without_a_face(root, run, capsys):
    fill(root / "board" / "bus", 3)
    (root / "board" / "bus" / "__init__.py").write_text("")
    assert run("--names") == 0
    assert "without a face: board.bus" in capsys.readouterr().out.splitlines()


def test_structure_as_json_exits_with_0(root, run, capsys):
    fill(root / "board", MOST_FILES + 1)
    assert run("--json") == 0
    assert f'"files in board/": {MOST_FILES + 1}' in capsys.readouterr().out
