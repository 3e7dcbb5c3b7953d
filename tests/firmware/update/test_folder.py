"""The folder of updates: one at a time, and how the last one ended."""

from pathlib import Path

import pytest

from board.runtime.errors import StationError
from firmware.update.folder import Folder, LockedError


def test_lock_that_another_update_has_is_refused(folder: Folder, tmp_path: Path):
    with (
        folder.locked(),
        pytest.raises(LockedError),
        Folder(tmp_path).locked(),
    ):
        raise AssertionError("the second one has it too")
    with Folder(tmp_path).locked(), pytest.raises(LockedError), folder.locked():
        raise AssertionError("the first one has it still")


def test_lock_without_a_folder_is_refused(tmp_path: Path):
    with pytest.raises(StationError, match="none: No such file"), Folder(tmp_path / "none").locked():
        raise AssertionError("there is none")


def test_result_of_an_update_is_kept_and_garbage_in_its_place_is_none(folder: Folder):
    assert folder.last() == {}
    folder.note_result("http://x/y", "1.2.3", "B", "installed")
    assert folder.last()["result"] == "installed"
    signed = f"https://x/y?signature={'a' * 8000}"
    folder.note_result(signed, "1.2.3", "B", f"{signed}: the server forbids it")
    assert folder.last()["source"] == signed
    for octets in (b"", b"[]", b"\xff", b"{" * 100_000):
        (folder.place / "last.json").write_bytes(octets)
        assert folder.last() == {}
