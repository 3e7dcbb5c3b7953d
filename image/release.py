"""What is handed out beside a card: programs, Debian packages, the card packed, and checksums of it all."""

import platform
import shutil
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from image import binary, build, checksum, deb, frozen, layers, licences
from image.program import run
from image.project import epoch, version
from image.step import key

SUMS = "SHA256SUMS"
# As Debian calls this machine's processor, which names the package, and as Linux does, which names the program.
DEBIAN = {"x86_64": "amd64", "aarch64": "arm64"}


class Artefact(NamedTuple):
    """A file that is handed out.

    most_mb  that it may have; 0: as it comes.
    said     by its program, when it was run.
    """

    path: Path
    most_mb: float = 0.0
    said: str = ""

    @property
    def is_ok(self) -> bool:
        return not self.most_mb or self.path.stat().st_size <= self.most_mb * 1e6

    def __str__(self) -> str:
        goal = f"goal: at most {self.most_mb:g} MB" if self.most_mb else ""
        size = f"{self.path.stat().st_size / 1e6:7.1f} MB"
        return f"{'ok' if self.is_ok else 'MISSED':6}  {self.path.name:36} {size}  {goal:22} {self.said}".rstrip()


def make(made: build.Build, card: build.Card, to: Path) -> list[Artefact]:
    """All of it, in a folder that holds nothing else. Raises ImageError."""
    to.mkdir(parents=True, exist_ok=True)
    number, now = version(), epoch()
    kept = _card(made, card)
    here = _of_this_machine(number, now, to)
    there = _of_the_card(made, number, now, to)
    copies = [Artefact(_copy(path, to)) for path in (kept, card.bundle, card.packages, card.licences)]
    artefacts = sorted([*here, *there, *copies])
    write_sums(artefacts, to)
    return artefacts


def write_sums(artefacts: Sequence[Artefact], to: Path) -> None:
    """Of a folder that then holds nothing else."""
    names = {artefact.path.name for artefact in artefacts}
    for path in to.iterdir():  # of an earlier version
        if path.name not in names:
            path.unlink()
    (to / SUMS).write_text(checksum.sums(each.path for each in artefacts))


def _card(made: build.Build, card: build.Card) -> Path:
    """The card as .xz, which Raspberry Pi Imager reads; in blocks of one size, whatever the number of threads."""
    name = f"{card.image.name}.xz"

    def pack(folder: Path) -> None:
        run(["sh", "-c", 'xz -3 -T2 --block-size=16MiB --stdout "$1" >"$2"', "sh", card.image, folder / name])

    return made.steps.made("packed", [key(made.steps.folder / "card")], pack) / name


def _of_this_machine(number: str, now: int, to: Path) -> list[Artefact]:
    directory, file = binary.make()
    machine = platform.machine()
    program = _copy(file, to, f"captain-{number}-{machine}")
    site = Path(run([binary.FREEZER, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"]).strip())
    documents = licences.documents(directory, site, licences.of_this_machine(directory, binary.FREEZER))
    package = to / f"captain_{number}_{DEBIAN[machine]}.deb"
    deb.make(directory, DEBIAN[machine], number, documents, now, package)
    with tempfile.TemporaryDirectory() as name:
        said = _said(package, Path(name), lambda words: run([f"{name}{words[0]}", *words[1:]]))
    return [
        Artefact(program, layers.MOST_MB_OF_FILE, run([program, "--version"]).strip()),
        Artefact(package, said=said),
    ]


def _of_the_card(made: build.Build, number: str, now: int, to: Path) -> list[Artefact]:
    """Run in the root that it was frozen in: there is its C library."""
    folder = made.steps.folder
    root, directory = folder / "freezer/root", folder / "program/captain"
    program = to / f"captain-{number}-aarch64"
    layers.one_file(directory, frozen.TOOLS, program)
    package = to / f"captain_{number}_arm64.deb"
    deb.make(directory, "arm64", number, frozen.documents(root, directory), now, package)
    place = frozen.cleared(root / frozen.WORK / "package")
    inside = Path("/") / place.relative_to(root)
    said = _said(package, place, lambda words: frozen.run_inside(root, [f"{inside}{words[0]}", *words[1:]]))
    shutil.copy(program, place / "program")
    of_file = frozen.run_inside(root, [inside / "program", "--version"]).strip()
    return [Artefact(program, layers.MOST_MB_OF_FILE, of_file), Artefact(package, said=said)]


def _said(package: Path, place: Path, inside: Callable[[list[str]], str]) -> str:
    """What its program says, unpacked into an empty root."""
    run(["dpkg-deb", "--extract", package, place])
    return inside(["/usr/bin/captain", "--version"]).strip()


def _copy(path: Path, to: Path, name: str = "") -> Path:
    return Path(shutil.copy(path, to / (name or path.name)))
