"""Whatever becomes of the folder for state, the station goes on, counts what was refused, and says what to do."""

import errno
import json
import os
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from board.machine import Machine
from board.runtime import state_file
from board.runtime.errors import StorageError
from firmware.station import storage
from firmware.station.storage import Kept, Storage
from tests.virtual import VirtualLoop

MOUNT = "36 35 8:1 / {point} rw,noatime - {kind} /dev/x rw\n"


@pytest.fixture(autouse=True)
def refusals(monkeypatch: pytest.MonkeyPatch) -> state_file.Refusals:
    found = state_file.Refusals()
    monkeypatch.setattr(state_file, "REFUSALS", found)
    return found


class Bench:
    """A folder on a file system of some kind, and stations one after the other."""

    def __init__(self, folder: Path) -> None:
        self.loop = VirtualLoop()
        self.folder = folder / "state"
        self.folder.mkdir()
        self._proc = folder / "proc"
        (self._proc / "self").mkdir(parents=True)
        self.mounted("ext4")

    def mounted(self, kind: str) -> None:
        lines = [MOUNT.format(point="/", kind="overlay"), MOUNT.format(point=self.folder, kind=kind)]
        (self._proc / "self/mountinfo").write_text("".join(lines))

    def started(self) -> Storage:
        made = Storage(self.loop, str(self.folder), Machine(proc=self._proc))
        made.start()
        self.loop.run_for(5)
        return made


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path)


def file_system(monkeypatch: pytest.MonkeyPatch, **words: int) -> None:
    """What the kernel says of the folder's file system."""
    told = {"f_flag": 0, "f_bavail": 10_000, "f_frsize": 4096, "f_files": 100, "f_favail": 50, **words}
    monkeypatch.setattr(storage.os, "statvfs", lambda path: SimpleNamespace(**told))


def refusing(monkeypatch: pytest.MonkeyPatch, number: int) -> None:
    def refuse(*_: Any) -> int:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(state_file.os, "fsync", refuse)


def test_a_folder_that_keeps_what_is_written_needs_no_hint(bench: Bench):
    told = bench.started().status()
    assert (told["state"], told["hint"], told["refused"]) == ("kept", "", 0)
    assert told["free_octets"] > 0  # type: ignore[operator]


def test_starts_are_counted_and_those_after_a_run_that_nobody_ended(bench: Bench):
    for ending in (True, False, True, True):
        station = bench.started()
        if ending:
            station.stop()
            station.stop()
    told = bench.started().status()
    assert (told["starts"], told["unclean_starts"]) == (5, 1)


def test_a_station_waits_for_no_card_before_it_runs(bench: Bench):
    Storage(bench.loop, str(bench.folder)).start()
    assert not list(bench.folder.iterdir())


READ_ONLY, FULL, NO_FILES = {"f_flag": os.ST_RDONLY}, {"f_bavail": 10}, {"f_favail": 0}


@pytest.mark.parametrize(
    ("words", "number", "state", "hint"),
    [
        (READ_ONLY, errno.EROFS, Kept.READ_ONLY, "replace it"),
        (FULL, errno.ENOSPC, Kept.FULL, "remove recordings"),
        (NO_FILES, errno.ENOSPC, Kept.FULL, "remove recordings"),
    ],
)
def test_a_folder_that_takes_nothing_is_told_counted_and_no_end(
    bench: Bench,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    words: dict[str, int],
    number: int,
    state: Kept,
    hint: str,
):
    file_system(monkeypatch, **words)
    with monkeypatch.context() as patch:
        refusing(patch, number)
        station = bench.started()
        bench.loop.run_for(100)
        told = station.status()
        assert told["state"] == state
        assert hint in str(told["hint"])
        assert told["refused"] == 1  # this start; and it is not tried every ten seconds
        assert os.strerror(number) in str(told["last_refusal"])
        assert [record.message for record in caplog.records] == [f"{bench.folder}: {state}: {told['hint']}"]
        station.stop()
    monkeypatch.undo()


def test_a_folder_that_is_not_there_is_told_and_comes_back(bench: Bench):
    bench.folder.rmdir()
    station = bench.started()
    assert station.status()["state"] == "absent"
    assert station.status()["free_octets"] == 0
    assert station.status()["refused"] == 1
    bench.folder.mkdir()
    bench.loop.run_for(20)
    told = station.status()
    assert told["state"] == "kept"
    assert json.loads((bench.folder / "starts.json").read_text())["starts"] == 1
    assert told["refused"] == 1  # what was refused stays counted


@pytest.mark.parametrize("is_noticed", [True, False])
def test_what_to_do_about_a_refusal_is_told_until_a_write_is_taken_again(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, is_noticed: bool
):
    station = bench.started()
    with monkeypatch.context() as patch:
        refusing(patch, errno.ENOSPC)
        if is_noticed:
            file_system(patch, **FULL)
        with pytest.raises(StorageError):
            state_file.keep(bench.folder / "leap.json", b"{}")
        bench.loop.run_for(20)
        assert "remove recordings" in str(station.status()["hint"])
    bench.loop.run_for(20)
    if not is_noticed:  # what the folder is never was another
        state_file.keep(bench.folder / "leap.json", b"{}")
    told = station.status()
    assert (told["state"], told["hint"], told["refused"]) == ("kept", "", 1)
    assert "No space left" in str(told["last_refusal"])


@pytest.mark.parametrize("kind", ["tmpfs", "overlay"])
def test_what_lies_in_memory_is_not_kept(bench: Bench, kind: str):
    bench.mounted(kind)
    told = bench.started().status()
    assert told["state"] == "memory"
    assert "lost at power-off" in str(told["hint"])


def test_a_folder_of_another_user_is_told(bench: Bench, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(storage.os, "access", lambda path, mode: False)
    assert bench.started().status()["state"] == "denied"


def test_what_changes_while_the_station_runs_is_told_once(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
):
    caplog.set_level("INFO")
    station = bench.started()
    with monkeypatch.context() as patch:
        file_system(patch, f_flag=os.ST_RDONLY)
        bench.loop.run_for(60)
        assert station.status()["state"] == "read-only"
    bench.loop.run_for(60)
    assert station.status()["state"] == "kept"
    assert [record.levelname for record in caplog.records] == ["WARNING", "INFO"]


@pytest.mark.parametrize(
    "octets", [b"", b"\0" * 100, b"[]", b'{"starts": "x"}', b'{"starts": -7}', b"x" * 5000, b"\xff"]
)
def test_a_count_that_is_damaged_begins_anew(bench: Bench, octets: bytes):
    (bench.folder / "starts.json").write_bytes(octets)
    assert bench.started().status()["starts"] == 1


@pytest.mark.parametrize("text", ["", "\n", "36 35 8:1 / /\n", "x" * 9])
def test_a_list_of_mounts_that_says_nothing_is_no_end(bench: Bench, tmp_path: Path, text: str):
    (tmp_path / "proc/self/mountinfo").write_text(text)
    assert bench.started().status()["state"] == "kept"


def test_where_nobody_expects_a_folder_nothing_is_said(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.delenv("STATE_DIRECTORY", raising=False)
    loop = VirtualLoop()
    station = Storage(loop)
    station.start()
    station.stop()
    assert station.status() == {}


def test_systemd_says_which_folder_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("STATE_DIRECTORY", f"{tmp_path}:/another")
    assert Storage(VirtualLoop()).status()["folder"] == str(tmp_path)
