"""image.toml: what the card is made of. Every mistake in it is told with its place, its value and a remedy."""

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from hashlib import sha256
from pathlib import Path
from typing import Literal

from image import reading, state, values
from image.errors import ImageError
from image.reading import show

# Of ours on the boot partition, whose names no other file there may have; a FAT takes A for a.
ON_BOOT = ("u-boot.bin", "boot.scr", "config.txt", "README.txt", "overlays")
PARTITIONS = {"boot": "fat", "root-a": "root", "root-b": "root", "state": "raw", "data": "data"}
NUMBERS = [1, 2, 3, 5, 6]
# MiB that a partition of a kind has at least, and for what.
LEAST = {
    "fat": (33, "a FAT32 has 65525 clusters of 512 octets and more"),
    "root": (512, "Debian's userland, kernel and captain take 350 MB, and a later version may take more"),
    "raw": (8, "its second copy begins at 4 MiB"),
    "data": (256, "its journal has 16 MiB, the log 48, an update that is fetched 160"),
}


@dataclass(frozen=True)
class Beside:
    """[[base.beside]]: one more archive. site: its URL; keyring: path of the keys that its lists are signed with."""

    site: values.Site
    suite: values.Suite
    components: values.Components
    keyring: values.Keyring


@dataclass(frozen=True)
class Base:
    """[base]: the distribution. keyring: path of the keys that its lists are signed with.

    mends  what the suite's name is followed by where its mends are: -security; the same keys and components.
    """

    suite: values.Suite
    architecture: Literal["arm64"]
    components: values.Components
    keyring: values.Keyring
    mends: values.Mends = ()
    beside: tuple[Beside, ...] = ()


@dataclass(frozen=True)
class Kernel:
    """[kernel]: modules are those of the early boot; command_line is added to what the boot script says."""

    package: values.Package
    modules: values.Modules
    command_line: values.CommandLine = ""


@dataclass(frozen=True)
class Firmware:
    """[firmware]: files of a folder of the package, which go to the boot partition."""

    package: values.Package
    folder: values.Path
    files: values.Files


@dataclass(frozen=True)
class Loader:
    """[loader]: U-Boot for the board."""

    package: values.Package
    file: values.Path


@dataclass(frozen=True)
class DeviceTree:
    """[device_tree]: how the board's needs get into the tree: by dtc when the image is built, or by the firmware."""

    way: Literal["dtc", "overlays"]
    folder: values.Path
    files: values.Trees
    board: values.Board
    pulse_gpio: values.Gpio | None = None
    i2c: values.I2c = ()
    uarts: values.Uarts = ()


@dataclass(frozen=True)
class Console:
    """[console]: the serial port that a person is shown the station at."""

    device: values.Tty
    baud: values.Baud


@dataclass(frozen=True)
class Partition:
    """[[disk.partitions]]: id is a FAT's serial number (8 hexadecimal digits) or an ext4's UUID; raw has none."""

    name: str
    number: int
    kind: Literal["fat", "root", "raw", "data"]
    size_mib: values.Mib
    id: str = ""


@dataclass(frozen=True)
class Disk:
    """[disk]: the whole card, with a table of the kind that the Pi's boot ROM reads."""

    label_id: values.LabelId
    size_mib: values.Mib
    partitions: tuple[Partition, ...]

    def partition(self, name: str) -> Partition:
        """Raises KeyError."""
        return {partition.name: partition for partition in self.partitions}[name]

    def partuuid(self, name: str) -> str:
        return f"{self.label_id:08x}-{self.partition(name).number:02x}"


@dataclass(frozen=True)
class Packages:
    """[packages.*]: name = reason."""

    install: values.Packages
    unpack: values.Packages
    freeze: values.Packages


@dataclass(frozen=True)
class Release:
    """[release]: programs for other machines. suite: oldest Debian they run on; packages: what freezes them there."""

    suite: values.Suite
    packages: values.Packages


@dataclass(frozen=True)
class Description:
    """The whole of image.toml."""

    name: values.Name
    base: Base
    kernel: Kernel
    firmware: Firmware
    loader: Loader
    device_tree: DeviceTree
    console: Console
    disk: Disk
    packages: Packages
    release: Release

    @property
    def released(self) -> Base:
        """Archive of the release's suite: that of [base], without those beside it, which are of the card's suite."""
        return replace(self.base, suite=self.release.suite, beside=())

    @property
    def compatible(self) -> str:
        """What a box and an update have to agree in.

        The last word is of what no update writes, and a slot needs: what the device trees are made of, which lie on the
        boot partition, where the partitions are found, and which words of the counters the boot script there keeps.
        """
        places = {one.name: self.disk.partuuid(one.name) for one in self.disk.partitions}
        beside = json.dumps([self.kernel.package, asdict(self.device_tree), places, state.WORDS])
        return f"{self.name} {self.base.suite} {self.device_tree.board} {sha256(beside.encode()).hexdigest()[:8]}"


def read(path: Path) -> Description:
    """The description in a file. Raises ImageError with a line for each mistake."""
    found = reading.read(Description, path)
    if mistakes := [f"{path}: {mistake}" for mistake in _mistakes(found)]:
        raise ImageError("\n".join(mistakes))
    return found


def _mistakes(found: Description) -> Iterator[str]:
    """What each value by itself cannot show."""
    yield from _of_disk(found.disk)
    yield from _of_partitions(found.disk)
    twice = found.packages.install.keys() & found.packages.unpack.keys()
    yield from (f"packages: {name} is in install and in unpack; it is needed once" for name in sorted(twice))
    taken = {name.lower() for name in ON_BOOT}
    for name in (*found.firmware.files, *found.device_tree.files):
        if name.lower() in taken:
            yield f"firmware.files, device_tree.files: there is another {name} on the boot partition; leave it out"
        taken.add(name.lower())


def _of_disk(disk: Disk) -> Iterator[str]:
    used = sum(partition.size_mib for partition in disk.partitions)
    room = disk.size_mib - 8  # the table, the logical partitions' own, and the steps of 4 MiB between
    if used > room:
        yield f"disk.size_mib: {disk.size_mib}: the partitions take {used} of {room} MiB; make one smaller"
    if disk.size_mib & (disk.size_mib - 1):
        yield f"disk.size_mib: {disk.size_mib} is no power of two; an emulated card has to be one"


def _of_partitions(disk: Disk) -> Iterator[str]:
    kinds = {partition.name: partition.kind for partition in disk.partitions}
    if kinds != PARTITIONS or len(disk.partitions) != len(PARTITIONS):
        yield f"disk.partitions: {kinds} are not the five that the boot script knows; they are {PARTITIONS}"
        return
    numbers = [partition.number for partition in disk.partitions]
    if numbers != NUMBERS:
        yield f"disk.partitions: {numbers} are not {NUMBERS}; the boot script counts on them, and 4 holds 5 and 6"
    one, other, data = (disk.partition(name) for name in ("root-a", "root-b", "data"))
    if one.size_mib != other.size_mib:
        yield (
            f"disk.partitions: root-a and root-b have {one.size_mib} and {other.size_mib} MiB, not the same size; "
            "an update has to fit either"
        )
    if one.id != other.id:
        yield f"disk.partitions: root-a and root-b have not the same id: {one.id}, {other.id}; they are copies"
    if data.id in (one.id, other.id):
        yield f"disk.partitions: data and a root have the same id: {data.id}; give data another"
    for partition in disk.partitions:
        yield from _of_partition(partition)


def _of_partition(partition: Partition) -> Iterator[str]:
    place = f"disk.partitions: {partition.name}"
    least, reason = LEAST[partition.kind]
    if partition.size_mib < least:
        yield f"{place}: size_mib {partition.size_mib} is less than {least} MiB; {reason}"
    digits = {"fat": (8,), "root": (8, 4, 4, 4, 12), "data": (8, 4, 4, 4, 12), "raw": ()}[partition.kind]
    parts = partition.id.split("-") if partition.id else []
    if tuple(map(len, parts)) != digits or any(set(part) - set("0123456789abcdef") for part in parts):
        form = "-".join("x" * count for count in digits) or "nothing"
        yield f"{place}: id {show(partition.id)} has not the form {form}"
