"""What is handed out beside a card: programs, Debian packages, the card packed, and checksums of it all."""

import shutil
from contextlib import closing
from pathlib import Path

from image import build
from image.description import Description
from image.program import run
from image.programs import Artefact, Programs, write_sums
from image.step import key

PROGRAMS = "programs"  # the folder they are built in, within the card's


def make(made: build.Build, card: build.Card, to: Path) -> list[Artefact]:
    """All of it, in a folder that holds nothing else. Raises ImageError."""
    found = make_programs(made.description, made.steps.folder, to)
    parts = (_packed(made, card), card.bundle, card.packages, card.licences)
    artefacts = sorted([*found, *(Artefact(Path(shutil.copy(path, to))) for path in parts)])
    write_sums(artefacts, to)
    return artefacts


def make_programs(description: Description, folder: Path, to: Path, upgrade: bool = False) -> list[Artefact]:
    """Programs and Debian packages alone, without a card. folder: the card's, where its build works."""
    with closing(Programs(description, folder / PROGRAMS)) as programs:
        found = sorted(programs.make(to, upgrade))
    write_sums(found, to)
    return found


def _packed(made: build.Build, card: build.Card) -> Path:
    """The card as .xz, which Raspberry Pi Imager reads; in blocks of one size, whatever the number of threads."""
    name = f"{card.image.name}.xz"

    def pack(folder: Path) -> None:
        run(["sh", "-c", 'xz -3 -T2 --block-size=16MiB --stdout "$1" >"$2"', "sh", card.image, folder / name])

    return made.steps.made("packed", [key(made.steps.folder / "card")], pack) / name
