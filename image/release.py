"""What is handed out beside a card: programs, Debian packages, the card packed, and checksums of it all."""

import shutil
from pathlib import Path

from image import build, programs
from image.program import run
from image.programs import Artefact
from image.step import key


def make(made: build.Build, card: build.Card, to: Path) -> list[Artefact]:
    """All of it, in a folder that holds nothing else. Raises ImageError."""
    found = programs.make(made.description, made.steps.folder, to)
    parts = (_packed(made, card), card.bundle, card.packages, card.licences)
    artefacts = sorted([*found, *(Artefact(Path(shutil.copy(path, to))) for path in parts)])
    programs.write_sums(artefacts, to)
    return artefacts


def _packed(made: build.Build, card: build.Card) -> Path:
    """The card as .xz, which Raspberry Pi Imager reads; in blocks of one size, whatever the number of threads."""
    name = f"{card.image.name}.xz"

    def pack(folder: Path) -> None:
        run(["sh", "-c", 'xz -3 -T2 --block-size=16MiB --stdout "$1" >"$2"', "sh", card.image, folder / name])

    return made.steps.made("packed", [key(made.steps.folder / "card")], pack) / name
