"""The whole build, step by step: packages, userland, kernel, early boot, captain, boot partition, card."""

import hashlib
import json
import os
import re
import shutil
import tarfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

from image import boot, disk, frozen, initrd, kernel, root, state
from image.description import Description
from image.errors import ImageError
from image.packages import Archive, Package, read_list, write_list
from image.program import run
from image.step import Steps, key

HERE = Path(__file__).parent
PROJECT = HERE.parent
BUILT = PROJECT / "build/image"
GROUPS = ("userland", "unpacked", "freezer", "tools")

_CHRONY = "from pps import chrony_configuration as c; print(c.configuration(), c.access('captain'), sep='\\0')"


class Card(NamedTuple):
    """What a build leaves: the image and what is told of it."""

    image: Path
    slot: Path  # the file system of a root slot: what an update brings
    packages: Path
    licences: Path
    checksums: Path
    took: dict[str, float]


class Build:
    """A build of a description in a folder, where what it fetched and made is kept for the next one."""

    def __init__(self, description: Description, folder: Path = BUILT) -> None:
        self.description = description
        self.steps = Steps(folder)
        self._archive = Archive(folder / "archive", description.base)
        self._native = Archive(folder / "native", description.base, _native_architecture())
        self._files = self.steps.folder / "archive/archives"

    def card(self, upgrade: bool = False) -> Card:
        """Everything. upgrade: newest packages, even where there is a kept set. Raises ImageError."""
        chosen = self._packages(upgrade)
        lists = {name: read_list(chosen / f"{name}.json") for name in GROUPS}
        tools = self._tools(lists["tools"])
        # Both are emulated, and each keeps one processor busy: they are made at the same time.
        with ThreadPoolExecutor(2) as pool:
            emulated = [
                pool.submit(self._userland, lists["userland"]),
                pool.submit(self._program, lists["freezer"]),
            ]
            unpacked = self._unpacked(lists["unpacked"])
            early = self._early(unpacked)
        userland, program = (step.result() for step in emulated)
        parts = self._parts(tools, userland, unpacked, early, program)
        return self._card(parts, lists, userland, unpacked)

    def _packages(self, upgrade: bool) -> Path:
        """Which packages of which version: a list of each group, and the files, compared with the lists' hashes."""
        wanted = self.description.packages
        words = [json.dumps([*map(str, (self.description.base, self.description.kernel.package)), *group])
                 for group in (wanted.install, wanted.unpack, wanted.freeze)]  # fmt: skip

        def make(folder: Path) -> None:
            description = self.description
            self._archive.update()
            image = self._archive.behind(description.kernel.package)
            alone = [image, description.firmware.package, description.loader.package, *wanted.unpack]
            self._native.update()
            found = {
                "userland": self._archive.closed(["?essential", *wanted.install]),
                "unpacked": self._archive.alone(alone),
                "freezer": self._archive.closed(wanted.freeze),
                "tools": self._native.closed(["e2fsprogs", "libarchive13t64"]),
            }
            for name, packages in found.items():
                write_list(folder / f"{name}.json", packages)

        return self.steps.made("packages", [*words, HERE / "packages.py"], make, forced=upgrade)

    def _paths(self, packages: list[Package]) -> list[Path]:
        found = [self._files / package.file for package in packages]
        missing = [path.name for path in found if not path.exists()]
        if missing:
            raise ImageError(f"{missing[0]} is no longer in {self._files}", "python -m image build --upgrade")
        return found

    def _tools(self, packages: list[Package]) -> Path:
        def make(folder: Path) -> None:
            for package in packages:
                run(["dpkg-deb", "-x", self.steps.folder / "native/archives" / package.file, folder])

        return self.steps.made("tools", [str(packages)], make)

    def _userland(self, packages: list[Package]) -> Path:
        names = list(self.description.packages.install)

        def make(folder: Path) -> None:
            self._paths(packages)
            root.install(packages, self._files, names, folder / "root.tar")

        options = [root.EPOCH, *names]
        return self.steps.made("userland", [str(packages), *options], make)

    def _unpacked(self, packages: list[Package]) -> Path:
        return self.steps.made(
            "kernel", [str(packages)], lambda folder: kernel.unpack(self._paths(packages), folder / "tree")
        )

    def _early(self, unpacked: Path) -> Path:
        modules = self.description.kernel.modules
        sources = [initrd.SCRIPT, HERE / "initrd.py", HERE / "cpio.py", HERE / "tree.py"]
        return self.steps.made(
            "early",
            [key(unpacked), *modules, *sources],
            lambda folder: initrd.make(kernel.Kernel(unpacked / "tree"), modules, folder / "initrd"),
        )

    def _program(self, packages: list[Package]) -> Path:
        unpacked = self.steps.made(
            "freezer", [str(packages)], lambda folder: frozen.unpack(self._paths(packages), folder / "root")
        )

        def make(folder: Path) -> None:
            made = frozen.freeze(unpacked / "root", frozen.own_python())
            shutil.copytree(made, folder / "captain", symlinks=True)

        return self.steps.made("program", [key(unpacked), *frozen.inputs()], make)

    def _parts(self, tools: Path, userland: Path, unpacked: Path, early: Path, program: Path) -> Path:
        """File systems of the partitions."""
        description = self.description
        plan = description.disk
        board = PROJECT / f"board/boards/{description.device_tree.board}.toml"
        now = epoch()
        written = _written()

        def make(folder: Path) -> None:
            its_kernel = kernel.Kernel(unpacked / "tree")
            boot.make(description, its_kernel, board, folder / "boot")
            tar = folder / "root.tar"
            parts = root.Parts(userland / "root.tar", its_kernel, early / "initrd", program / "captain", written)
            root.compose(description, parts, now, tar)
            disk.make_fat(plan.partition("boot"), folder / "boot", folder / "boot.fat", now)
            disk.make_ext4(plan.partition("root-a"), tar, folder / "root.ext4", now, tools, journal=False)
            disk.make_ext4(plan.partition("data"), None, folder / "data.ext4", now, tools, journal=True)
            (folder / "state.raw").write_bytes(state.blank())

        own = [path for path in sorted(HERE.rglob("*")) if path.is_file() and path.suffix != ".pyc"]
        made_from = [key(step) for step in (tools, userland, unpacked, early, program)]
        return self.steps.made("parts", [str(description), str(now), *written.values(), *made_from, board, *own], make)

    def _card(self, parts: Path, lists: dict[str, list[Package]], userland: Path, unpacked: Path) -> Card:
        description = self.description
        name = f"{description.name}-{version()}-{description.base.architecture}"
        files = {
            "boot": "boot.fat",
            "root-a": "root.ext4",
            "root-b": "root.ext4",
            "state": "state.raw",
            "data": "data.ext4",
        }
        folder = self.steps.folder.parent
        card = Card(
            folder / f"{name}.img",
            parts / "root.ext4",
            folder / f"{name}.packages.json",
            folder / f"{name}.licences.tar.xz",
            folder / f"{name}.sha256",
            self.steps.took,
        )

        def make(_: Path) -> None:
            disk.make(description.disk, {part: parts / file for part, file in files.items()}, card.image)
            write_list(card.packages, [*lists["userland"], *lists["unpacked"]])
            _write_licences(parts / "root.tar", card.licences)
            sums = [f"{_sha256(path)}  {path.name}\n" for path in (card.image, card.packages, card.licences)]
            card.checksums.write_text("".join(sums))

        is_there = all(path.exists() for path in card[:5] if isinstance(path, Path))
        self.steps.made("card", [key(parts)], make, forced=not is_there)
        return card


def compress(image: Path) -> Path:
    """Beside it, as .xz, which Raspberry Pi Imager reads; in blocks of one size, whatever the number of threads."""
    run(["xz", "-k", "-f", "-3", "-T2", "--block-size=16MiB", image])
    return image.with_suffix(".img.xz")


def epoch() -> int:
    """The date of the build: SOURCE_DATE_EPOCH, or that of the last commit. Unix seconds."""
    given = os.environ.get("SOURCE_DATE_EPOCH", "")
    if given.isdecimal():
        return int(given)
    try:
        return int(run(["git", "log", "-1", "--format=%ct"], folder=PROJECT))
    except (ImageError, ValueError) as error:
        raise ImageError("the date of the build is not known: this is no git tree", "set SOURCE_DATE_EPOCH") from error


def version() -> str:
    found = re.search(r'^VERSION = "([^"]+)"', (PROJECT / "firmware/__init__.py").read_text(), re.MULTILINE)
    if not found:
        raise ImageError("firmware/__init__.py: has no VERSION")
    return found[1]


def _written() -> dict[str, str]:
    """What the station's own code writes for the image: nothing of the project is imported here."""
    said = run([frozen.own_python(), "-c", _CHRONY], folder=PROJECT)
    whole, _, access = said.partition("\0")
    return {
        "etc/chrony/chrony.conf": whole,
        "etc/systemd/system/chrony.service.d/captain.conf": access.rstrip("\n") + "\n",
    }


def _write_licences(tree: Path, target: Path) -> None:
    """The copyright file of every package, without dates."""
    with tarfile.open(tree) as source, tarfile.open(target, "w:xz") as archive:
        for member in source:
            if re.fullmatch("usr/share/doc/[^/]+/copyright", member.name):
                archive.addfile(member, source.extractfile(member) if member.isreg() else None)


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _native_architecture() -> str:
    return run(["dpkg", "--print-architecture"]).strip()
