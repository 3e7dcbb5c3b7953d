"""Files of a release: programs, Debian packages, their repository, compressed card with its manifest."""

import shutil
from pathlib import Path

from image import checksum, manifest
from image.card import build
from image.program import programs, repository
from image.program.programs import Artefact
from image.project import epoch, version
from image.step import key
from image.tool import run

REPOSITORY = "apt"


def make(made: build.Build, card: build.CardBuild, to: Path, key: str = "") -> list[Artefact]:
    """Make all files of a release in a folder of their own. Raises ImageError if a step fails.

    key  fingerprint of the key that signs the packages' repository; empty: no signature.
    """
    found = programs.make(made.description, made.steps.folder, to)
    parts = (_packed(made, card), card.bundle, card.packages, card.licences)
    copies = [Path(shutil.copy(path, to)) for path in parts]
    listed = to / card.manifest.name
    listed.write_text(manifest.text(card.image, checksum.sha256(card.image), copies[0], version(), epoch()))
    artefacts = sorted([*found, *map(Artefact, (*copies, listed))])
    programs.write_sums(artefacts, to)
    packages = [row.path for row in artefacts if row.path.suffix == ".deb"]
    repository.make(packages, [each.debian for each in programs.PROCESSORS], epoch(), to / REPOSITORY, key)
    return artefacts


def _packed(made: build.Build, card: build.CardBuild) -> Path:
    """Compress the card to .xz, which Raspberry Pi Imager reads; fixed blocks give equal octets with any threads."""
    name = f"{card.image.name}.xz"

    def pack(folder: Path) -> None:
        run(["sh", "-c", 'xz -3 -T2 --block-size=16MiB --stdout "$1" >"$2"', "sh", card.image, folder / name])

    return made.steps.made("packed", [key(made.steps.folder / "card")], pack) / name
