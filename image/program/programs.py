"""Programs for other machines: frozen from an older Debian's Python, per processor."""

import json
import shutil
from contextlib import closing
from pathlib import Path
from typing import NamedTuple

from image import checksum
from image.description import Description
from image.errors import ImageError
from image.packages import Archive, Package, native_architecture, paths, read_list, write_list
from image.program import box, container, deb, developer, freezing, frozen
from image.program.contents import layers
from image.program.translated import C_LIBRARY
from image.project import epoch, version
from image.step import Steps
from image.tool import run

HERE = Path(__file__).parents[1]
PROCESSORS = (frozen.X86_64, frozen.AARCH64)
SUMS = "SHA256SUMS"
_CONTAINER_LIST = "-container.json"  # list of the packages in the OCI image
FOLDER = "programs"  # folder of fetched and made files, within that of the card


class Artefact(NamedTuple):
    """File of a release.

    most_mb   limit in 10**6 octets; 0: none.
    said      output of its program in a trial run.
    unpacked  octets of the directory to which it unpacks; the limit then applies to them. None: it applies to the file.
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
    """Build programs and Debian packages, without a card. The caller then calls write_sums().

    card     work folder of the card's build; may be empty.
    to       folder of the results; made if missing.
    upgrade  use the newest packages instead of a kept set.

    Raises ImageError if a step fails.
    """
    with closing(Programs(description, card / FOLDER)) as made:
        return sorted(made.make(to, upgrade))


class Programs:
    """Builds programs in a folder, which keeps fetched and made files. Each method raises ImageError on failure."""

    def __init__(self, description: Description, folder: Path) -> None:
        self.steps = Steps(folder)
        self._description = description
        names = {native_architecture(), *(processor.debian for processor in PROCESSORS)}
        self._archives = {name: Archive(self._files(name).parent, description.released, name) for name in names}

    def close(self) -> None:
        self.steps.close()

    def make(self, to: Path, upgrade: bool = False) -> list[Artefact]:
        """Make one file, two Debian packages and an OCI image per processor; then captain-box for both.

        Each program runs once.

        upgrade  use the newest packages instead of a kept set.
        """
        to.mkdir(parents=True, exist_ok=True)
        lists = self._lists(upgrade)
        chosen = {
            name: freezing.Chosen(read_list(lists / f"{name}.json"), self._files(name)) for name in self._archives
        }
        here = chosen[native_architecture()]
        made = []
        for processor in PROCESSORS:
            steps = freezing.Freezing(self.steps, processor, processor.debian)
            directory = steps.program(chosen[processor.debian], here) / "captain"
            check_c_library(directory, chosen[processor.debian].packages)
            root = self.steps.folder / processor.debian / "freezer/root"
            program, package = _handed_out(directory, root.resolve(), processor, to)
            made += [program, package]
            tree = developer.installed(self.steps, f"{processor.debian}/developer", processor.triple)
            check_c_library(tree, chosen[processor.debian].packages)
            made.append(of_developer(tree, processor.debian, to))
            beside = paths(self._files(processor.debian), read_list(lists / f"{processor.debian}{_CONTAINER_LIST}"))
            made.append(_image([*beside, package.path], processor.debian, to))
        return [*made, of_box(to)]

    def _lists(self, upgrade: bool) -> Path:
        """Choose packages by architecture, fetch them, verify their hashes; return the folder of the lists."""
        names = self._description.release.packages

        def make(folder: Path) -> None:
            for architecture, archive in self._archives.items():
                archive.update()
                write_list(folder / f"{architecture}.json", archive.closed(names))
                write_list(folder / f"{architecture}{_CONTAINER_LIST}", archive.alone(container.PACKAGES))

        words = json.dumps([str(self._description.released), *names, *sorted(self._archives), *container.PACKAGES])
        return self.steps.made("packages", [words, HERE / "packages.py"], make, forced=upgrade)

    def _files(self, architecture: str) -> Path:
        return self.steps.folder / "archives" / architecture / "archives"


def check_c_library(directory: Path, packages: list[Package]) -> None:
    """Compare the C library that a program needs with that of its release.

    Raises ImageError if it needs a newer one.

    Messages and simulated radio are linked with the C library of this machine's compiler, which may be newer.
    """
    own = next(package.version.split("-")[0] for package in packages if package.name == C_LIBRARY)
    needed = deb.c_library(directory)
    if deb.numbers(needed) > deb.numbers(own):
        raise ImageError(f"{directory}: needs C library {needed}; its release has {own}", "build on an older Debian")


def write_sums(artefacts: list[Artefact], to: Path) -> None:
    """Write the checksums, and remove other files from the folder; folders in it stay."""
    names = {artefact.path.name for artefact in artefacts}
    for path in to.iterdir():  # files of an earlier version
        if path.name not in names and not path.is_dir():
            path.unlink()
    (to / SUMS).write_text(checksum.sums(each.path for each in artefacts))


def _handed_out(directory: Path, root: Path, processor: frozen.Processor, to: Path) -> list[Artefact]:
    """Make file and package, and run both in the root in which they were frozen, because of its C library."""
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


def _image(packages: list[Path], architecture: str, to: Path) -> Artefact:
    image = to / f"captain-{version()}-{architecture}.oci.tar"
    container.make(packages, architecture, epoch(), image)
    return Artefact(image)


def of_box(to: Path) -> Artefact:
    """Make the Debian package captain-box in a folder. Raises ImageError if that fails."""
    package = to / f"{box.NAME}_{version()}_all.deb"
    box.make(version(), epoch(), package)
    return Artefact(package)


def of_developer(tree: Path, architecture: str, to: Path) -> Artefact:
    """Make the Debian package captain-dev in a folder. tree: its files. Raises ImageError if that fails."""
    package = to / f"{developer.NAME}_{version()}_{architecture}.deb"
    developer.make(tree, architecture, version(), epoch(), package)
    return Artefact(package)


def of_directory(package: Path, directory: Path, said: str) -> Artefact:
    """Return the artefact of a Debian package; its limit applies to the program's directory."""
    return Artefact(package, layers.MOST_MB, said, layers.octets(directory))
