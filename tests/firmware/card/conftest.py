"""An owner's files on a card."""

import re
import time
from pathlib import Path
from typing import Protocol

import pytest

from firmware.card.note import Note
from firmware.card.ssh_keys import sound_keys
from firmware.card.verdict import Verdict, verdict

KEY = "ssh-ed25519 AAAAC3NzaC1lZDI1NTE5AAAAIG5QZ1u1f8oMAbrUoaqgzTVh2tFvWYAEBoCd2aSxVTpF me"
OVERLAY = Path(__file__).resolve().parents[3] / "image/overlay"

Files = dict[str, str | bytes]
# The keys that a note begins with: of the file, and of an interface's options.
KEYED = re.compile(r'(?:[\w.\[\]"-]+: ){1,2}')


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
    keys = sound_keys("authorized_keys", [(1, text)], notes)
    assert all(note.is_mistake for note in notes)
    return keys, [note.text for note in notes]


def mistakes(found: Verdict) -> list[str]:
    return [note.text for note in found.notes if note.is_mistake]


def remarks(found: Verdict) -> list[str]:
    return [note.text for note in found.notes if not note.is_mistake]


def refused(found: Verdict) -> list[str]:
    """Place and key of each mistake, such as "box.toml:3 wifi.country"."""
    return [where(note) for note in found.notes if note.is_mistake]


def noted(found: Verdict) -> list[str]:
    """Place and key of each remark."""
    return [where(note) for note in found.notes if not note.is_mistake]


def where(note: Note) -> str:
    key = KEYED.match(note.what)
    return f"{note.place} {key[0].rstrip(': ')}" if key else note.place
