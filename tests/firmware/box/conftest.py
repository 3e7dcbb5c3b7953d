"""An owner's files on a card."""

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Protocol

import pytest

from firmware.box.note import Note
from firmware.box.ssh_keys import sound_keys
from firmware.box.update_folder import Folder
from firmware.box.verdict import Verdict, verdict
from tests.firmware.box.web_site import Site

KEY = "ssh-ed25519 AAAAC3NzaC1lZDI1NTE5AAAAIG5QZ1u1f8oMAbrUoaqgzTVh2tFvWYAEBoCd2aSxVTpF me"
OVERLAY = Path(__file__).resolve().parents[3] / "image/overlay"

Files = dict[str, str | bytes]


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


@pytest.fixture
def folder(tmp_path: Path) -> Folder:
    """Of updates, as the lock makes it."""
    (tmp_path / "fetched").mkdir(exist_ok=True)
    return Folder(tmp_path, reserve=0)
