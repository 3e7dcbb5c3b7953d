"""image.toml: what the card is made of. Every mistake in it is told with its place, its value and a remedy."""

import difflib
import json
import tomllib
import types
from dataclasses import MISSING, asdict, dataclass, fields, is_dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any, Literal, TypeVar, get_args, get_origin, get_type_hints

from image import state
from image.errors import ImageError

T = TypeVar("T")

LARGEST_LABEL = 0xFFFFFFFF
FIRST_LOGICAL = 5  # of an MBR: partitions 1 to 4 are in its table, 4 holds the rest
WORDS = {str: "text in quotes", int: "an integer", bool: "true or false", dict: "a table", list: "an array"}


@dataclass(frozen=True)
class Beside:
    """[[base.beside]]: one more archive. site: its URL; keyring: path of the keys that its lists are signed with."""

    site: str
    suite: str
    components: tuple[str, ...]
    keyring: str


@dataclass(frozen=True)
class Base:
    """[base]: the distribution. keyring: path of the keys that its lists are signed with.

    mends  what the suite's name is followed by where its mends are: -security; the same keys and components.
    """

    suite: str
    architecture: Literal["arm64"]
    components: tuple[str, ...]
    keyring: str
    mends: tuple[str, ...] = ()
    beside: tuple[Beside, ...] = ()


@dataclass(frozen=True)
class Kernel:
    """[kernel]: modules are those of the early boot; command_line is added to what the boot script says."""

    package: str
    modules: tuple[str, ...]
    command_line: str = ""


@dataclass(frozen=True)
class Firmware:
    """[firmware]: files of a folder of the package, which go to the boot partition."""

    package: str
    folder: str
    files: tuple[str, ...]


@dataclass(frozen=True)
class Loader:
    """[loader]: U-Boot for the board."""

    package: str
    file: str


@dataclass(frozen=True)
class DeviceTree:
    """[device_tree]: how the board's needs get into the tree: by dtc when the image is built, or by the firmware."""

    way: Literal["dtc", "overlays"]
    folder: str
    files: tuple[str, ...]
    board: str
    pulse_gpio: int | None = None
    i2c: tuple[int, ...] = ()
    uarts: tuple[int, ...] = ()


@dataclass(frozen=True)
class Console:
    """[console]: the serial port that a person is shown the station at."""

    device: str
    baud: int


@dataclass(frozen=True)
class Partition:
    """[[disk.partitions]]: id is a FAT's serial number (8 hexadecimal digits) or an ext4's UUID; raw has none."""

    name: str
    number: int
    kind: Literal["fat", "root", "raw", "data"]
    size_mib: int
    id: str = ""


@dataclass(frozen=True)
class Disk:
    """[disk]: the whole card, with a table of the kind that the Pi's boot ROM reads."""

    label_id: int
    size_mib: int
    partitions: tuple[Partition, ...]

    def partition(self, name: str) -> Partition:
        """Raises KeyError."""
        return {partition.name: partition for partition in self.partitions}[name]

    def partuuid(self, name: str) -> str:
        return f"{self.label_id:08x}-{self.partition(name).number:02x}"


@dataclass(frozen=True)
class Packages:
    """[packages.*]: name = reason."""

    install: dict[str, str]
    unpack: dict[str, str]
    freeze: dict[str, str]


@dataclass(frozen=True)
class Description:
    """The whole of image.toml."""

    name: str
    base: Base
    kernel: Kernel
    firmware: Firmware
    loader: Loader
    device_tree: DeviceTree
    console: Console
    disk: Disk
    packages: Packages

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
    """The description in a file. Raises ImageError."""
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ImageError(f"{path}: cannot be read: {error.strerror}", "name a file like image/image.toml") from error
    except ValueError as error:  # UnicodeDecodeError and TOMLDecodeError
        raise ImageError(f"{path}: is not TOML: {error}") from error
    try:
        found = _filled(Description, table, "")
        _look_through(found)
    except ImageError as error:
        raise ImageError(f"{path.name}: {error}") from error
    return found


def _filled(kind: type[T], table: dict[str, Any], place: str) -> T:
    """A table as a dataclass."""
    hints = get_type_hints(kind)
    for key in table:
        if key not in hints:
            near = difflib.get_close_matches(key, hints, 1)
            raise ImageError(
                f"{place}{key}: there is no such key", f"did you mean {near[0]}?" if near else _known(hints)
            )
    values = {}
    assert is_dataclass(kind)
    for field in fields(kind):
        if field.name in table:
            values[field.name] = _value(hints[field.name], table[field.name], place + field.name)
        elif field.default is MISSING:
            raise ImageError(f"{place}{field.name}: is missing")
    return kind(**values)


def _known(hints: dict[str, Any]) -> str:
    return "known: " + ", ".join(hints)


def _value(kind: Any, value: Any, place: str) -> Any:
    origin = get_origin(kind)
    if origin is Literal:
        if value not in get_args(kind):
            raise ImageError(f"{place}: {value!r} is none of {', '.join(get_args(kind))}")
        return value
    if origin is types.UnionType:
        return _value(get_args(kind)[0], value, place)  # X | None: TOML has no null
    if origin is tuple:
        _demand(list, value, place)
        return tuple(_value(get_args(kind)[0], each, f"{place}[{index}]") for index, each in enumerate(value))
    if origin is dict:
        _demand(dict, value, place)
        return {key: _value(get_args(kind)[1], each, f"{place}.{key}") for key, each in value.items()}
    if is_dataclass(kind):
        _demand(dict, value, place)
        return _filled(kind, value, place + ".")  # type: ignore[arg-type]
    _demand(kind, value, place)
    return value


def _demand(kind: type, value: Any, place: str) -> None:
    if type(value) is not kind:
        raise ImageError(f"{place}: {value!r} is not {WORDS[kind]}")


def _look_through(found: Description) -> None:
    """What each value by itself cannot show."""
    disk = found.disk
    if not 0 < disk.label_id <= LARGEST_LABEL:
        raise ImageError(f"disk.label_id: {disk.label_id:#x} has more than 32 bits, or none")
    _look_through_partitions(disk)
    used = sum(partition.size_mib for partition in disk.partitions)
    room = disk.size_mib - 8  # the table, the logical partitions' own, and the steps of 4 MiB between
    if used > room:
        raise ImageError(
            f"disk.size_mib: {disk.size_mib}: the partitions take {used} of {room} MiB", "make one smaller"
        )
    if disk.size_mib & (disk.size_mib - 1):
        raise ImageError(f"disk.size_mib: {disk.size_mib} is no power of two", "an emulated card has to be one")
    for name in (*found.packages.install, *found.packages.unpack, *found.packages.freeze):
        groups = [group for group in ("install", "unpack") if name in getattr(found.packages, group)]
        if len(groups) > 1:
            raise ImageError(f"packages: {name} is in {' and in '.join(groups)}", "it is needed once")
    for group in ("install", "unpack", "freeze"):
        for name, reason in getattr(found.packages, group).items():
            if not reason.strip():
                raise ImageError(f"packages.{group}.{name}: has no reason", "say what it is for, or leave it out")
    tree = found.device_tree
    for place, number, low, high in (
        *((f"device_tree.i2c[{index}]", number, 0, 6) for index, number in enumerate(tree.i2c)),
        *((f"device_tree.uarts[{index}]", number, 2, 5) for index, number in enumerate(tree.uarts)),
        *([("device_tree.pulse_gpio", tree.pulse_gpio, 0, 27)] if tree.pulse_gpio is not None else []),
    ):
        if not low <= number <= high:
            raise ImageError(f"{place}: {number} is not {low} to {high}")


def _look_through_partitions(disk: Disk) -> None:
    wanted = {"boot": "fat", "root-a": "root", "root-b": "root", "state": "raw", "data": "data"}
    kinds = {partition.name: partition.kind for partition in disk.partitions}
    if kinds != wanted or len(disk.partitions) != len(wanted):
        raise ImageError(f"disk.partitions: {kinds} are not the five that the boot script knows", f"they are {wanted}")
    numbers = [partition.number for partition in disk.partitions]
    if numbers != [1, 2, 3, 5, 6]:
        raise ImageError(
            f"disk.partitions: {numbers} are not 1, 2, 3, 5, 6", "the boot script counts on them; 4 holds 5 and 6"
        )
    if disk.partition("root-a").size_mib != disk.partition("root-b").size_mib:
        raise ImageError("disk.partitions: root-a and root-b have not the same size", "an update has to fit either")
    if disk.partition("state").size_mib < 8:
        raise ImageError("disk.partitions: state has less than 8 MiB", "its second copy begins at 4 MiB")
    for partition in disk.partitions:
        digits = {"fat": (8,), "root": (8, 4, 4, 4, 12), "data": (8, 4, 4, 4, 12), "raw": ()}[partition.kind]
        parts = partition.id.split("-") if partition.id else []
        if tuple(map(len, parts)) != digits or any(set(part) - set("0123456789abcdef") for part in parts):
            form = "-".join("x" * count for count in digits) or "nothing"
            raise ImageError(f"disk.partitions: {partition.name}: id {partition.id!r} has not the form {form}")
