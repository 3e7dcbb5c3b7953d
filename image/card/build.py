"""Build of the card, step by step, from packages to image."""

import inspect
import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

from board.runtime import boot_counters
from image import checksum, manifest
from image.card import bundle, keys
from image.description import Description
from image.filesystem import disk
from image.manual import files
from image.packages import Archive, Package, native_architecture, paths, read_list, write_list
from image.parts import boot, device_tree, initrd, kernel, root, slot_names
from image.program import freezing, frozen, licences
from image.project import PROJECT, chrony, epoch, version
from image.step import Steps, key
from image.tool import run

HERE = Path(__file__).parents[1]
BUILT = PROJECT / "build/image"
KEYS = "keys"
GROUPS = ("userland", "unpacked", "freezer", "here", "tools")


class CardBuild(NamedTuple):
    """Results of a build: the card's image and the files beside it."""

    image: Path
    slot: Path  # file system of a root slot
    bundle: Path  # the slot as a signed update
    packages: Path
    licences: Path
    checksums: Path
    manifest: Path  # for Raspberry Pi Imager
    took: dict[str, float]


class Build:
    """Build of a description in a folder, which keeps fetched and made files for the next build."""

    def __init__(self, description: Description, folder: Path = BUILT) -> None:
        self.description = description
        date = epoch()  # raises its error before anything is made
        self.steps = Steps(folder)
        self._archive = Archive(folder / "archive", description.base)
        self._native = Archive(folder / "native", description.base, native_architecture())
        self._files = self.steps.folder / "archive/archives"
        self._native_files = self.steps.folder / "native/archives"
        self.keys = keys.chosen(self.steps.folder / KEYS, date)

    def card(self, upgrade: bool = False) -> CardBuild:
        """Build the card. upgrade: use the newest packages instead of a kept set. Raises ImageError if a step fails."""
        parts = self.parts(upgrade)
        return self._card(parts, self._lists(upgrade=False))

    def parts(self, upgrade: bool = False) -> Path:
        """Make the file systems, which contain no signature; return their folder. Raises ImageError if a step fails."""
        lists = self._lists(upgrade)
        tools = self._tools(lists["tools"])
        # The userland is emulated: it takes longest and keeps one processor busy. The other one does the rest
        # meanwhile.
        with ThreadPoolExecutor(1) as pool:
            emulated = pool.submit(self._userland, lists["userland"])
            unpacked = self._unpacked(lists["unpacked"])
            early = self._early(unpacked)
            program = self._program(lists["freezer"], lists["here"])
        return self._parts(tools, emulated.result(), unpacked, early, program)

    def assemble(self, parts: Path, target: Path) -> None:
        """Assemble the card from these file systems. Raises ImageError if that fails."""
        slot = parts / "root.ext4"
        files = {
            "boot": parts / "boot.fat",
            "root-a": slot,
            "root-b": slot,
            "state": parts / "state.raw",
            "data": parts / "data.ext4",
        }
        disk.make(self.description.disk, files, target)

    def _lists(self, upgrade: bool) -> dict[str, list[Package]]:
        chosen = self._packages(upgrade)
        return {name: read_list(chosen / f"{name}.json") for name in GROUPS}

    def _packages(self, upgrade: bool) -> Path:
        """Choose packages and versions, fetch them and verify their hashes; return the folder of the groups' lists."""
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
                "here": self._native.closed(wanted.freeze),
                "tools": self._native.closed(["e2fsprogs", "libarchive13t64"]),
            }
            for name, packages in found.items():
                write_list(folder / f"{name}.json", packages)

        return self.steps.made("packages", [*words, *GROUPS, HERE / "packages.py"], make, forced=upgrade)

    def _tools(self, packages: list[Package]) -> Path:
        def make(folder: Path) -> None:
            for path in paths(self._native_files, packages):
                run(["dpkg-deb", "-x", path, folder])

        return self.steps.made("tools", [str(packages)], make)

    def _userland(self, packages: list[Package]) -> Path:
        names = list(self.description.packages.install)

        def make(folder: Path) -> None:
            paths(self._files, packages)
            root.install(packages, self._files, names, folder / "root.tar")

        options = [root.EPOCH, *names, inspect.getsource(root.install)]  # the only part of root.py used here
        return self.steps.made("userland", [str(packages), *options], make)

    def _unpacked(self, packages: list[Package]) -> Path:
        return self.steps.made(
            "kernel",
            [str(packages), HERE / "parts/kernel.py"],
            lambda folder: kernel.unpack(paths(self._files, packages), folder / "tree"),
        )

    def _early(self, unpacked: Path) -> Path:
        modules = self.description.kernel.modules
        sources = [initrd.SCRIPT, HERE / "parts/initrd.py", HERE / "filesystem/tree.py"]
        return self.steps.made(
            "early",
            [key(unpacked), *modules, *sources],
            lambda folder: initrd.make(kernel.Kernel(unpacked / "tree"), modules, folder / "initrd"),
        )

    def _program(self, packages: list[Package], same_here: list[Package]) -> Path:
        made = freezing.Freezing(self.steps, frozen.AARCH64)
        return made.program(freezing.Chosen(packages, self._files), freezing.Chosen(same_here, self._native_files))

    def _parts(self, tools: Path, userland: Path, unpacked: Path, early: Path, program: Path) -> Path:
        """Make the file systems of the partitions; return their folder."""
        description = self.description
        plan = description.disk
        board = PROJECT / f"board/boards/{description.device_tree.board}.toml"
        now = epoch()
        written = chrony(frozen.own_python()) | {
            slot_names.PATH: slot_names.rules(device_tree.read_board(board)),
            "etc/rauc/keyring.pem": self.keys.keyring.read_text(),
            "usr/lib/captain-image/signer": f"{self.keys.kind} {keys.subject(self.keys.certificate)}\n",
            **files.made(version(), now),
        }

        def make(folder: Path) -> None:
            its_kernel = kernel.Kernel(unpacked / "tree")
            boot.make(description, its_kernel, board, folder / "boot")
            tar = folder / "root.tar"
            documents = frozen.documents(self.steps.folder / "freezer/root", program / "captain")
            parts = root.Parts(
                userland / "root.tar", its_kernel, early / "initrd", program / "captain", documents, written
            )
            root.compose(description, parts, now, tar)
            disk.make_fat(plan.partition("boot"), folder / "boot", folder / "boot.fat", now)
            disk.make_ext4(plan.partition("root-a"), tar, folder / "root.ext4", now, tools, journal=False)
            disk.make_ext4(plan.partition("data"), None, folder / "data.ext4", now, tools, journal=True)
            (folder / "state.raw").write_bytes(boot_counters.blank())

        own = [path for path in sorted(HERE.rglob("*")) if path.is_file() and path.suffix != ".pyc"]
        own += licences.own_documents().values()
        made_from = [key(step) for step in (tools, userland, unpacked, early, program)]
        return self.steps.made("parts", [str(description), str(now), *written.values(), *made_from, board, *own], make)

    def _card(self, parts: Path, lists: dict[str, list[Package]]) -> CardBuild:
        card = planned(self.description, self.steps.folder)._replace(took=self.steps.took)

        def make(_: Path) -> None:
            self.assemble(parts, card.image)
            # mmdebstrap does not install apt, which apt itself counts as essential.
            installed = root.installed(self.steps.folder / "userland/root.tar")
            userland = [package for package in lists["userland"] if package.name in installed]
            write_list(card.packages, [*userland, *lists["unpacked"]])
            licences.pack(parts / "root.tar", card.licences)
            kept = (card.image, card.bundle, card.packages, card.licences)
            sums = checksum.sums(kept)
            card.checksums.write_text(sums)
            card.manifest.write_text(manifest.text(card.image, sums.split()[0], card.image, version(), epoch()))

        update = self._bundle(parts, card.bundle)
        is_there = all(path.exists() for path in card[:7] if isinstance(path, Path))
        self.steps.made("card", [key(parts), key(update)], make, forced=not is_there)
        return card

    def _bundle(self, parts: Path, target: Path) -> Path:
        """Make the update bundle of the slot, beside the card."""
        tools, words, now = self.steps.folder / "tools", self.description.compatible, epoch()
        made_from: list[str | Path] = [
            key(parts),
            HERE / "card/bundle.py",
            words,
            version(),
            str(now),
            self.keys.key,
            self.keys.certificate,
        ]
        return self.steps.made(
            "bundle",
            made_from,
            lambda _: bundle.make(parts / "root.ext4", words, version(), now, self.keys, tools, target),
            forced=not target.exists(),
        )


def planned(description: Description, folder: Path) -> CardBuild:
    """Return the paths of a build's results, beside its folder; nothing is made."""
    name = f"{description.name}-{version()}-{description.base.architecture}"
    beside = folder.resolve().parent
    return CardBuild(
        beside / f"{name}.img",
        folder.resolve() / "parts/root.ext4",
        beside / f"{name}.raucb",
        beside / f"{name}.packages.json",
        beside / f"{name}.licences.tar.xz",
        beside / f"{name}.sha256",
        beside / f"{name}{manifest.SUFFIX}",
        {},
    )
