"""Description of the card, read from image.toml; reports mistakes with place and remedy."""

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from hashlib import sha256
from pathlib import Path
from typing import Literal

from board.runtime import boot_counters, describe
from board.runtime.errors import ConfigurationError
from board.runtime.toml import show
from image import values
from image.errors import ImageError

# Our own files on the boot partition; no other file may have these names, also not in another case, because FAT ignores
# it.
ON_BOOT = ("u-boot.bin", "boot.scr", "config.txt", "README.txt", "overlays")
PARTITIONS = {"boot": "fat", "root-a": "root", "root-b": "root", "state": "raw", "data": "data"}
NUMBERS = [1, 2, 3, 5, 6]
# Least size of a partition in MiB by its kind, and the reason.
LEAST = {
    "fat": (33, "a FAT32 has 65525 clusters of 512 octets and more"),
    "root": (512, "Debian's userland, kernel and captain take 350 MB, and a later version may take more"),
    "raw": (8, "its second copy begins at 4 MiB"),
    "data": (256, "its journal has 16 MiB, the log 48, an update that is fetched 160"),
}


@dataclass(frozen=True)
class Beside:
    """[[base.beside]]: an additional archive. site: its URL; keyring: path of the keys that sign its lists."""

    site: values.Site
    suite: values.Suite
    components: values.Components
    keyring: values.Keyring


@dataclass(frozen=True)
class Base:
    """[base]: the distribution. keyring: path of the keys that sign its lists.

    mends  suffixes of the suite's update archives, such as -security; they have the same keys and components.
    """

    suite: values.Suite
    architecture: Literal["arm64"]
    components: values.Components
    keyring: values.Keyring
    mends: values.Mends = ()
    beside: tuple[Beside, ...] = ()


@dataclass(frozen=True)
class Kernel:
    """[kernel]: modules are those of the early boot; command_line is added to that of the boot script."""

    package: values.Package
    modules: values.Modules
    command_line: values.CommandLine = ""


@dataclass(frozen=True)
class Firmware:
    """[firmware]: files in a folder of the package that are copied to the boot partition."""

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
    """[device_tree]: additions for the board, by dtc during the build, or by overlays that the firmware loads."""

    way: Literal["dtc", "overlays"]
    folder: values.Path
    files: values.Trees
    board: values.Board
    pulse_gpio: values.Gpio | None = None
    i2c: values.I2c = ()
    uarts: values.Uarts = ()


@dataclass(frozen=True)
class Console:
    """[console]: the serial port that shows the station's status."""

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
    """[disk]: the whole card, with a partition table of the kind that the Pi's boot ROM reads."""

    label_id: values.LabelId
    size_mib: values.Mib
    partitions: tuple[Partition, ...]

    def partition(self, name: str) -> Partition:
        """Return a partition by its name. Raises KeyError for an unknown name."""
        return {partition.name: partition for partition in self.partitions}[name]

    def partuuid(self, name: str) -> str:
        return f"{self.label_id:08x}-{self.partition(name).number:02x}"


@dataclass(frozen=True)
class Packages:
    """[packages.*]: reasons by name of the package."""

    install: values.Packages
    unpack: values.Packages
    freeze: values.Packages


@dataclass(frozen=True)
class Release:
    """[release]: programs for other machines. suite: oldest Debian on which they run; packages: used to freeze them."""

    suite: values.Suite
    packages: values.Packages


@dataclass(frozen=True)
class Description:
    """Complete content of image.toml."""

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
        """Archive of the release's suite: [base] without its additional archives, which are of the card's suite."""
        return replace(self.base, suite=self.release.suite, beside=())

    @property
    def compatible(self) -> str:
        """Compatibility string, which must be equal in a box and an update.

        Its last word is a hash of parts that no update writes and a slot needs: the sources of the device trees on the
        boot partition, the places of the partitions, and the boot script's variables.
        """
        places = {one.name: self.disk.partuuid(one.name) for one in self.disk.partitions}
        beside = json.dumps([self.kernel.package, asdict(self.device_tree), places, boot_counters.WORDS])
        return f"{self.name} {self.base.suite} {self.device_tree.board} {sha256(beside.encode()).hexdigest()[:8]}"


def read(path: Path) -> Description:
    """Read the description in a file. Raises ImageError with a line per mistake."""
    try:
        found = describe.read(Description, describe.load(path), str(path))
    except ConfigurationError as error:
        raise ImageError(error.message, error.hint) from error
    if mistakes := [f"{path}: {mistake}" for mistake in _mistakes(found)]:
        raise ImageError("\n".join(mistakes))
    return found


def _mistakes(found: Description) -> Iterator[str]:
    """Yield mistakes in relations between values."""
    yield from _of_disk(found.disk)
    yield from _of_partitions(found.disk)
    twice = found.packages.install.keys() & found.packages.unpack.keys()
    yield from (f"packages: {name} is in install and in unpack; remove one of the two" for name in sorted(twice))
    taken = {name.lower() for name in ON_BOOT}
    for name in (*found.firmware.files, *found.device_tree.files):
        if name.lower() in taken:
            yield f"firmware.files, device_tree.files: there is another {name} on the boot partition; leave it out"
        taken.add(name.lower())


def _of_disk(disk: Disk) -> Iterator[str]:
    used = sum(partition.size_mib for partition in disk.partitions)
    room = disk.size_mib - 8  # 8 MiB for the tables of disk and logical partitions, and steps of 4 MiB
    if used > room:
        yield f"disk.size_mib: {disk.size_mib}: the partitions take {used} of {room} MiB; make one smaller"
    if disk.size_mib & (disk.size_mib - 1):
        yield f"disk.size_mib: {disk.size_mib} is not a power of two; an emulated card needs one"


def _of_partitions(disk: Disk) -> Iterator[str]:
    kinds = {partition.name: partition.kind for partition in disk.partitions}
    if kinds != PARTITIONS or len(disk.partitions) != len(PARTITIONS):
        yield f"disk.partitions: {kinds} are not the five partitions that the boot script knows: {PARTITIONS}"
        return
    numbers = [partition.number for partition in disk.partitions]
    if numbers != NUMBERS:
        yield f"disk.partitions: the numbers {numbers} are not {NUMBERS}, as the boot script needs; 4 holds 5 and 6"
    one, other, data = (disk.partition(name) for name in ("root-a", "root-b", "data"))
    if one.size_mib != other.size_mib:
        yield (
            f"disk.partitions: root-a and root-b have {one.size_mib} and {other.size_mib} MiB; make them equal, as "
            "an update must fit into either"
        )
    if one.id != other.id:
        yield f"disk.partitions: root-a and root-b have different ids, {one.id} and {other.id}; give both the same"
    if data.id in (one.id, other.id):
        yield f"disk.partitions: data and a root partition have the same id, {data.id}; give data another id"
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
