"""A generated directory: only ours is touched, and only what has changed."""

from collections.abc import Callable
from pathlib import Path

import pytest

from asn1.backends import output


def files(**contents: str) -> Callable[[Path], None]:
    """Fills a directory with files <name>.txt in a folder of their own."""

    def fill(folder: Path) -> None:
        for name, text in contents.items():
            path = folder / "sub" / f"{name}.txt"
            path.parent.mkdir(exist_ok=True)
            path.write_text(text)

    return fill


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.rglob("*.txt"))


def test_a_new_directory_is_made_with_its_parents(tmp_path: Path):
    assert output.write(tmp_path / "a" / "b", files(one="1"), "docs") == 1
    assert names(tmp_path / "a") == ["one.txt"]


def test_what_is_the_same_is_not_touched(tmp_path: Path):
    target = tmp_path / "a"
    output.write(target, files(one="1", two="2"), "docs")
    before = (target / "sub" / "one.txt").stat()
    assert output.write(target, files(one="1", two="changed"), "docs") == 1
    after = (target / "sub" / "one.txt").stat()
    assert (after.st_ino, after.st_mtime_ns) == (before.st_ino, before.st_mtime_ns)
    assert (target / "sub" / "two.txt").read_text() == "changed"


def test_what_is_no_longer_made_is_removed_and_what_others_put_there_stays(tmp_path: Path):
    target = tmp_path / "a"
    output.write(target, files(one="1", two="2"), "docs")
    (target / "build.txt").write_text("of somebody else")
    assert output.write(target, files(one="1"), "docs") == 1
    assert names(target) == ["build.txt", "one.txt"]


def test_a_directory_of_somebody_else_is_refused(tmp_path: Path):
    (tmp_path / "thesis.txt").write_text("years of work")
    with pytest.raises(output.NotOursError, match="not written by"):
        output.write(tmp_path, files(one="1"), "docs")
    assert names(tmp_path) == ["thesis.txt"]


def test_another_form_does_not_delete_what_is_there(tmp_path: Path):
    output.write(tmp_path / "a", files(one="1"), "docs")
    with pytest.raises(output.NotOursError, match=r"a: contains the format docs, not asn; choose another directory"):
        output.write(tmp_path / "a", files(two="2"), "asn")
    assert names(tmp_path / "a") == ["one.txt"]


def test_a_directory_of_an_older_version_says_no_form_and_is_taken(tmp_path: Path):
    output.write(tmp_path / "a", files(one="1"), "docs")
    (tmp_path / "a" / output.MANIFEST).write_text("sub/one.txt\n")
    assert output.write(tmp_path / "a", files(one="1"), "docs") == 0


def test_a_file_in_the_place_of_the_directory_is_refused(tmp_path: Path):
    (tmp_path / "a").write_text("")
    with pytest.raises(output.NotOursError, match="not a directory"):
        output.write(tmp_path / "a", files(one="1"), "docs")


def test_a_failure_half_way_leaves_the_directory_as_it_was(tmp_path: Path):
    output.write(tmp_path / "a", files(one="1"), "docs")

    def fail(folder: Path) -> None:
        files(one="other")(folder)
        raise RuntimeError

    with pytest.raises(RuntimeError):
        output.write(tmp_path / "a", fail, "docs")
    assert (tmp_path / "a" / "sub" / "one.txt").read_text() == "1"
    assert [path.name for path in tmp_path.iterdir()] == ["a"]
