"""The folder of updates: one at a time, and how the last one ended."""

from pathlib import Path

import pytest

from board.errors import StationError
from firmware.box.update_folder import Folder, LockedError


def test_two_updates_at_once_are_told(folder: Folder, tmp_path: Path):
    with (
        folder.locked(),
        pytest.raises(StationError, match="another update is running"),
        Folder(tmp_path).locked(),
    ):
        raise AssertionError("the second one has it too")
    with Folder(tmp_path).locked(), pytest.raises(LockedError), folder.locked():
        raise AssertionError("the first one has it still")


def test_a_folder_that_is_not_there_is_told(tmp_path: Path):
    with pytest.raises(StationError, match="no update can be prepared"), Folder(tmp_path / "none").locked():
        raise AssertionError("there is none")


def test_how_an_update_ended_is_kept_and_rubbish_in_its_place_is_none(folder: Folder):
    assert folder.last() == {}
    folder.tell("http://x/y", "1.2.3", "B", "installed")
    assert folder.last()["result"] == "installed"
    signed = f"https://x/y?signature={'a' * 8000}"
    folder.tell(signed, "1.2.3", "B", f"{signed}: the server forbids it")
    assert folder.last()["source"] == signed
    for octets in (b"", b"[]", b"\xff", b"{" * 100_000):
        (folder.place / "last.json").write_bytes(octets)
        assert folder.last() == {}
