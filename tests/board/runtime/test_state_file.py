"""State files: written whole or not; a refused write is counted."""

import errno
import os
from pathlib import Path

import pytest

from board.runtime import state_file
from board.runtime.errors import StorageError
from tests.said import tells

OLD, NEW = b"old" * 1000, b"new"


class Calls:
    """What the module asks of the kernel, in its order; one of the calls may fail."""

    def __init__(self, patch: pytest.MonkeyPatch, failing: str = "", number: int = errno.ENOSPC) -> None:
        self.made: list[str] = []
        self._failing = failing
        self._number = number
        self._names: dict[int, str] = {}
        for name in ("open", "write", "fsync", "rename", "unlink", "close"):
            patch.setattr(state_file.os, name, self._watched(name, getattr(os, name)))

    def _watched(self, name, real):
        def call(first, *rest, **words):
            what = self._names[first] if isinstance(first, int) else Path(first).name
            self.made.append(f"{name} {what}")
            if f"{name} {what}" == self._failing:
                raise OSError(self._number, os.strerror(self._number))
            found = real(first, *rest, **words)
            if name == "open":
                self._names[found] = what
            return found

        return call


@pytest.fixture(autouse=True)
def counted(monkeypatch: pytest.MonkeyPatch) -> state_file.Refusals:
    found = state_file.Refusals()
    monkeypatch.setattr(state_file, "REFUSALS", found)
    return found


@pytest.fixture
def path(tmp_path: Path) -> Path:
    folder = tmp_path / "folder"
    folder.mkdir()
    (folder / "x.json").write_bytes(OLD)
    return folder / "x.json"


def test_a_file_is_on_the_card_before_its_name_is_and_the_name_before_it_counts_as_kept(path, monkeypatch):
    calls = Calls(monkeypatch)
    state_file.keep(path, NEW)
    assert [call for call in calls.made if not call.startswith("close")] == [
        "open x.json.new",
        "write x.json.new",
        "fsync x.json.new",
        "rename x.json.new",
        "open folder",
        "fsync folder",
    ]
    assert path.read_bytes() == NEW


def test_what_is_kept_is_read_again_and_nothing_else_is_left(path):
    state_file.keep(path, NEW)
    assert state_file.read(path, 100) == NEW
    assert os.listdir(path.parent) == ["x.json"]
    assert path.stat().st_mode & 0o777 == 0o644


def test_a_secret_is_never_readable_by_others(path, monkeypatch):
    path.with_name("x.json.new").write_bytes(b"left by a cut")
    path.with_name("x.json.new").chmod(0o644)
    seen = []
    monkeypatch.setattr(state_file.os, "write", lambda file, octets: seen.append(os.fstat(file).st_mode) or len(octets))
    state_file.keep(path, NEW, 0o600)
    assert [mode & 0o777 for mode in seen] == [0o600]
    assert path.stat().st_mode & 0o777 == 0o600


def test_a_write_that_takes_a_part_goes_on(path, monkeypatch):
    real = os.write
    monkeypatch.setattr(state_file.os, "write", lambda file, octets: real(file, octets[:100]))
    state_file.keep(path, OLD + NEW)
    assert path.read_bytes() == OLD + NEW


@pytest.mark.parametrize("failing", ["open x.json.new", "write x.json.new", "fsync x.json.new", "rename x.json.new"])
@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EROFS, errno.EIO, errno.EDQUOT, errno.EACCES])
def test_a_write_that_is_refused_leaves_the_old_content_and_nothing_beside_it(path, monkeypatch, failing, number):
    with monkeypatch.context() as patch:
        calls = Calls(patch, failing, number)
        with pytest.raises(StorageError) as refused:
            state_file.keep(path, NEW)
    assert os.strerror(number) in refused.value.message
    assert str(path) in refused.value.message
    assert refused.value.hint
    assert path.read_bytes() == OLD
    assert os.listdir(path.parent) == ["x.json"]
    opened = sum(call.startswith("open") for call in calls.made) - (failing.startswith("open"))
    assert sum(call.startswith("close") for call in calls.made) == opened


def test_refusal_of_a_state_file_is_counted_with_its_reason(path, counted, monkeypatch):
    with monkeypatch.context() as patch:
        Calls(patch, "fsync x.json.new")
        for _ in range(2):
            with pytest.raises(StorageError):
                state_file.keep(path, NEW)
    assert counted.count == 2
    assert tells(counted.last, f"{path}: ", "written", os.strerror(errno.ENOSPC))
    assert "room" in counted.hint
    state_file.keep(path, NEW)
    assert counted.count == 2  # a fault that has gone stays counted


def test_state_file_in_an_absent_folder_is_refused_with_its_path(tmp_path):
    with pytest.raises(StorageError) as refused:
        state_file.keep(tmp_path / "no" / "x", NEW)
    assert os.strerror(errno.ENOENT) in refused.value.message
    assert str(tmp_path / "no") in refused.value.hint


def test_forgetting_a_file_is_kept_too_and_one_that_is_not_there_is_forgotten(path, monkeypatch):
    calls = Calls(monkeypatch)
    state_file.forget(path)
    state_file.forget(path)
    assert "fsync folder" in calls.made
    assert not path.exists()


def test_forgetting_where_nothing_is_taken_is_refused_and_counted(path, counted, monkeypatch):
    with monkeypatch.context() as patch:
        Calls(patch, "unlink x.json", errno.EROFS)
        with pytest.raises(StorageError, match="Read-only"):
            state_file.forget(path)
    assert counted.count == 1


def test_what_is_longer_than_any_of_it_may_be_is_not_read(path):
    assert state_file.read(path, len(OLD)) == OLD
    with pytest.raises(StorageError, match="longer than 10 octets"):
        state_file.read(path, 10)


def test_what_is_not_there_is_nothing_and_what_cannot_be_read_is_told(path):
    assert state_file.read(path.with_name("y"), 10) is None
    with pytest.raises(StorageError, match="cannot be read"):
        state_file.read(path.parent, 10)
