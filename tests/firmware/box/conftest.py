"""An owner's files on a card."""

from collections.abc import Callable
from pathlib import Path

import pytest

from firmware.box.verdict import Verdict, verdict

KEY = "ssh-ed25519 AAAAC3NzaC1lZDI1NTE5AAAAIG5QZ1u1f8oMAbrUoaqgzTVh2tFvWYAEBoCd2aSxVTpF me"
OVERLAY = Path(__file__).resolve().parents[3] / "image/overlay"

Files = dict[str, str | bytes]
Look = Callable[[Files], Verdict]


def write(folder: Path, files: Files) -> Path:
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content.encode() if isinstance(content, str) else content)
    return folder


@pytest.fixture
def look(tmp_path: Path) -> Look:
    """What a box says of files."""

    def looked(files: Files) -> Verdict:
        count = len(list(tmp_path.iterdir()))
        card, scratch = tmp_path / f"{count}-card", tmp_path / f"{count}-scratch"
        card.mkdir()
        scratch.mkdir()
        return verdict(write(card, files), scratch, "none", str(OVERLAY / "etc/captain/captain.toml"))

    return looked


def mistakes(found: Verdict) -> list[str]:
    return [note.text for note in found.notes if note.is_mistake]


def remarks(found: Verdict) -> list[str]:
    return [note.text for note in found.notes if not note.is_mistake]
