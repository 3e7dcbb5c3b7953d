"""captain for machines that are not the box: frozen from an older Debian's Python, for each processor."""

import json
import shutil
from contextlib import closing
from pathlib import Path
from typing import NamedTuple

from image import checksum, deb, freezing, frozen, layers
from image.description import Description
from image.errors import ImageError
from image.packages import Archive, Package, native_architecture, read_list, write_list
from image.program import run
from image.project import epoch, version
from image.step import Steps
from image.translated import C_LIBRARY

HERE = Path(__file__).parent
PROCESSORS = (frozen.X86_64, frozen.AARCH64)
SUMS = "SHA256SUMS"
FOLDER = "programs"  # of what was fetched and made, within the card's


class Artefact(NamedTuple):
    """A file that is handed out.

    most_mb   limit in 10**6 octets; 0: none.
    said      by its program, when it was run.
    unpacked  octets of the directory that it unpacks to, which are limited in its place; None: it is limited itself.
    """

    path: Path
    most_mb: float = 0.0
    said: str = ""
    unpacked: int | None = None

    @property
    def is_ok(self) -> bool:
        octets = self.path.stat().st_size if self.unpacked is None else self.unpacked
        return not self.most_mb or octets <= self.most_mb * 1e6

    def __str__(self) -> str:
        goal = f"goal: at most {self.most_mb:g} MB" if self.most_mb else ""
        if self.unpacked is not None:
            goal = f"unpacked {self.unpacked / 1e6:.1f} MB, {goal}"
        size = f"{self.path.stat().st_size / 1e6:7.1f} MB"
        return f"{'ok' if self.is_ok else 'MISSED':6}  {self.path.name:36} {size}  {goal:40} {self.said}".rstrip()


def make(description: Description, card: Path, to: Path, upgrade: bool = False) -> list[Artefact]:
    """Build programs and Debian packages, for which no card is needed; write_sums() is the caller's.

    card     folder in which the card's build works; may be empty.
    to       folder of the files; made if it is missing.
    upgrade  with the newest packages, even where there is a kept set.

    Raises ImageError.
    """
    with closing(Programs(description, card / FOLDER)) as made:
        return sorted(made.make(to, upgrade))


class Programs:
    """Builds them in a folder, where what was fetched and made is kept. Everything raises ImageError."""

    def __init__(self, description: Description, folder: Path) -> None:
        self.steps = Steps(folder)
        self._description = description
        names = {native_architecture(), *(processor.debian for processor in PROCESSORS)}
        self._archives = {name: Archive(self._files(name).parent, description.released, name) for name in names}

    def close(self) -> None:
        self.steps.close()

    def make(self, to: Path, upgrade: bool = False) -> list[Artefact]:
        """One file and a Debian package for each processor, each run once.

        upgrade  with the newest packages, even where there is a kept set.
        """
        to.mkdir(parents=True, exist_ok=True)
        chosen = self._chosen(upgrade)
        here = chosen[native_architecture()]
        made = []
        for processor in PROCESSORS:
            steps = freezing.Freezing(self.steps, processor, processor.debian)
            directory = steps.program(chosen[processor.debian], here) / "captain"
            check_c_library(directory, chosen[processor.debian].packages)
            root = self.steps.folder / processor.debian / "freezer/root"
            made += _handed_out(directory, root.resolve(), processor, to)
        return made

    def _chosen(self, upgrade: bool) -> dict[str, freezing.Chosen]:
        """The packages by architecture: a list of each, and the files, compared with the lists' hashes."""
        names = self._description.release.packages

        def make(folder: Path) -> None:
            for architecture, archive in self._archives.items():
                archive.update()
                write_list(folder / f"{architecture}.json", archive.closed(names))

        words = json.dumps([str(self._description.released), *names, *sorted(self._archives)])
        lists = self.steps.made("packages", [words, HERE / "packages.py"], make, forced=upgrade)
        return {name: freezing.Chosen(read_list(lists / f"{name}.json"), self._files(name)) for name in self._archives}

    def _files(self, architecture: str) -> Path:
        return self.steps.folder / "archives" / architecture / "archives"


def check_c_library(directory: Path, packages: list[Package]) -> None:
    """Refuse a program that needs a later C library than its release has. Raises ImageError.

    Messages and simulated radio are linked with the C library of this machine's compiler, which may be a later one.
    """
    own = next(package.version.split("-")[0] for package in packages if package.name == C_LIBRARY)
    needed = deb.c_library(directory)
    if deb.numbers(needed) > deb.numbers(own):
        raise ImageError(f"{directory}: needs C library {needed}; its release has {own}", "build on an older Debian")


def write_sums(artefacts: list[Artefact], to: Path) -> None:
    """Checksums, in a folder that then holds nothing else."""
    names = {artefact.path.name for artefact in artefacts}
    for path in to.iterdir():  # of an earlier version
        if path.name not in names:
            path.unlink()
    (to / SUMS).write_text(checksum.sums(each.path for each in artefacts))


def _handed_out(directory: Path, root: Path, processor: frozen.Processor, to: Path) -> list[Artefact]:
    """Run in the root that it was frozen in: there is its C library."""
    number = version()
    program = to / f"captain-{number}-{processor.name}"
    layers.one_file(directory, processor.tools, program)
    package = to / f"captain_{number}_{processor.debian}.deb"
    deb.make(directory, processor.debian, number, frozen.documents(root, directory), epoch(), package)
    place = frozen.cleared(root / frozen.WORK / "package")
    inside = Path("/") / place.relative_to(root)
    run(["dpkg-deb", "--extract", package, place])
    shutil.copy(program, place / "program")
    of_package, of_file = (
        frozen.run_inside(root, [inside / name, "--version"]).strip() for name in ("usr/bin/captain", "program")
    )
    return [Artefact(program, layers.MOST_MB_OF_FILE, of_file), of_directory(package, directory, of_package)]


def of_directory(package: Path, directory: Path, said: str) -> Artefact:
    """A Debian package, limited by the directory of the program in it."""
    return Artefact(package, layers.MOST_MB, said, layers.octets(directory))
