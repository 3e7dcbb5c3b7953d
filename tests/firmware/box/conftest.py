"""An owner's files on a card."""

import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Protocol

import pytest

from firmware.box import update, update_bundle, update_counters, update_slots
from firmware.box.note import Note
from firmware.box.ssh_keys import sound_keys
from firmware.box.update_bundle import Box, Bundle
from firmware.box.update_counters import Counters
from firmware.box.update_folder import Folder
from firmware.box.update_verity import Tree
from firmware.box.verdict import Verdict, verdict
from tests.broker.certificates import Authority
from tests.firmware.box.rauc_service import Service
from tests.firmware.box.web_site import Site

KEY = "ssh-ed25519 AAAAC3NzaC1lZDI1NTE5AAAAIG5QZ1u1f8oMAbrUoaqgzTVh2tFvWYAEBoCd2aSxVTpF me"
OVERLAY = Path(__file__).resolve().parents[3] / "image/overlay"

Files = dict[str, str | bytes]
Said = Callable[[], tuple[str, str]]  # what was written to both streams since it was asked last
BUNDLE = Bundle("x", 5000, "1.2.4", "captain trixie quad", "b", "O=captain", Tree(1, "", ""), 4_000_000)


class Look(Protocol):
    """What a box says of files; is_box: false for the computer that checks a card. later_s: than now."""

    def __call__(self, files: Files, /, is_box: bool = True, later_s: float = 0) -> Verdict: ...


def write(folder: Path, files: Files) -> Path:
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content.encode() if isinstance(content, str) else content)
    return folder


@pytest.fixture
def look(tmp_path: Path) -> Look:
    def looked(files: Files, /, is_box: bool = True, later_s: float = 0) -> Verdict:
        count = len(list(tmp_path.iterdir()))
        card, scratch = tmp_path / f"{count}-card", tmp_path / f"{count}-scratch"
        card.mkdir()
        scratch.mkdir()
        defaults = str(OVERLAY / "etc/captain/captain.toml") if is_box else None
        return verdict(write(card, files), scratch, "none", defaults, time.time() + later_s)

    return looked


def keys_of(text: str) -> tuple[list[str], list[str]]:
    """The lines of authorized_keys that are taken, and what is said of the others."""
    notes: list[Note] = []
    keys = sound_keys("authorized_keys", text, notes)
    assert all(note.is_mistake for note in notes)
    return keys, [note.text for note in notes]


def mistakes(found: Verdict) -> list[str]:
    return [note.text for note in found.notes if note.is_mistake]


def remarks(found: Verdict) -> list[str]:
    return [note.text for note in found.notes if not note.is_mistake]


@pytest.fixture
def site() -> Iterator[Site]:
    with Site().open() as found:
        yield found


@pytest.fixture(scope="module")
def authority(tmp_path_factory: pytest.TempPathFactory) -> Authority:
    return Authority(tmp_path_factory.mktemp("authority"))


@pytest.fixture
def folder(tmp_path: Path) -> Folder:
    """Of updates, as the lock makes it."""
    (tmp_path / "fetched").mkdir(exist_ok=True)
    return Folder(tmp_path, reserve=0)


@pytest.fixture
def service(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Service:
    """In a box whose bundles are all well signed."""
    (tmp_path / "bin").mkdir()
    made = Service(tmp_path / "bin")
    monkeypatch.setenv("PATH", f"{tmp_path / 'bin'}:{os.environ['PATH']}")
    counters = Counters(("B", "A"), {"A": 2, "B": 3}, "B")
    monkeypatch.setattr(update_counters, "read", lambda: counters)
    (tmp_path / "judged").write_text("well\n")
    monkeypatch.setattr(update._judged, "__defaults__", (tmp_path / "judged",))
    monkeypatch.setattr(update_slots, "largest", lambda slot: 1 << 20)
    monkeypatch.setattr(update_bundle, "box", lambda: Box("captain trixie quad", "a release image"))
    monkeypatch.setattr(update_bundle, "read", lambda path, name: BUNDLE)
    monkeypatch.setattr("firmware.box.update_verity.check", lambda path, name, tree, seen: seen(1.0))
    monkeypatch.setattr("firmware.commands.update.signal.signal", lambda number, action: None)
    (tmp_path / "update").mkdir()
    monkeypatch.setattr(update, "Folder", lambda: Folder(tmp_path / "update"))
    monkeypatch.setattr("firmware.commands.update.Folder", lambda: Folder(tmp_path / "update"))
    return made


@pytest.fixture
def bundle(tmp_path: Path) -> str:
    path = tmp_path / "update.raucb"
    path.write_bytes(b"x" * 5000)
    return str(path)


@pytest.fixture
def said(capsys: pytest.CaptureFixture[str]) -> Said:
    def said() -> tuple[str, str]:
        found = capsys.readouterr()
        return found.out, found.err

    return said
