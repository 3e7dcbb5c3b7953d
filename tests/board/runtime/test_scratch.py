"""A folder that goes with its process, and with the next one if it was killed."""

import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from board.runtime.scratch import LOCK, Scratch

HOLD = "from board.runtime.scratch import Scratch; s = Scratch('held-'); print(s.path, flush=True); input()"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", None)
    return tmp_path


def test_it_is_there_until_it_is_closed(folder: Path) -> None:
    scratch = Scratch("held-")
    assert scratch.path.parent == folder
    scratch.close()
    scratch.close()
    assert list(folder.iterdir()) == []


def test_it_is_in_memory_where_nobody_says_otherwise(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("TMPDIR")
    monkeypatch.setattr("board.runtime.scratch.MEMORY", str(folder))
    scratch = Scratch("held-")
    assert scratch.path.parent == folder
    scratch.close()


def test_without_memory_for_it_it_is_where_the_system_has_such(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("TMPDIR")
    monkeypatch.setattr("board.runtime.scratch.MEMORY", "/nowhere")
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    scratch = Scratch("held-")
    assert scratch.path.parent == folder
    scratch.close()


def test_it_goes_with_who_has_it(folder: Path) -> None:
    scratch = Scratch("held-")
    del scratch
    assert list(folder.iterdir()) == []


def test_what_lives_stays_and_what_was_killed_goes(folder: Path) -> None:
    holder = subprocess.Popen([sys.executable, "-c", HOLD], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert holder.stdout is not None
    held = Path(holder.stdout.readline().strip())
    Scratch("held-").close()
    assert (held / LOCK).exists()
    holder.send_signal(signal.SIGKILL)
    holder.communicate()
    Scratch("held-").close()
    assert not held.exists()


def test_a_process_that_ends_by_itself_leaves_nothing(folder: Path) -> None:
    subprocess.run([sys.executable, "-c", HOLD], input="\n", text=True, capture_output=True, check=True)
    assert list(folder.iterdir()) == []


def test_what_is_nobodys_of_ours_stays(folder: Path) -> None:
    (folder / "held-other").mkdir()
    (folder / "away-it").mkdir()
    (folder / "away-it" / LOCK).touch()
    (folder / "held-link").symlink_to(folder / "away-it")
    os.symlink(folder / "away-it" / LOCK, folder / "held-other" / LOCK)
    Scratch("held-").close()
    assert {path.name for path in folder.iterdir()} == {"held-other", "away-it", "held-link"}
