"""Writes an image to a card, after a question that cannot be answered by accident, and reads it back."""

import errno
import os
import stat
import sys
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO, NamedTuple

from image import checksum
from image.errors import ImageError

CHUNK = 4 << 20
LARGEST_GIB = 512  # a disk of a computer has more


class Users(NamedTuple):
    """What the kernel says of devices in use: /proc/self/mountinfo and /proc/swaps."""

    mounts: str
    swaps: str = ""


class Device:
    """A block device, as the kernel tells of it. sys_folder: for tests."""

    def __init__(self, path: Path, sys_folder: Path = Path("/sys/class/block")) -> None:
        self.path = path
        self._about = sys_folder / path.name

    @property
    def octets(self) -> int:
        return int(self._word("size") or 0) * 512

    @property
    def model(self) -> str:
        words = (self._word("device/vendor"), self._word("device/model"), self._word("device/name"))
        return " ".join(filter(None, words))

    def refuse(self, needed: int, users: Users) -> None:
        """Raises ImageError: it is no whole disk, too small, in use, or may well be a computer's own."""
        if not (self._about / "size").exists():
            raise ImageError(f"{self.path}: is no block device", "lsblk shows which there are")
        if (self._about / "partition").exists():
            raise ImageError(f"{self.path}: is a partition", "name the whole card, without its last number")
        used = self._used(users)
        if used:
            raise ImageError(f"{self.path}: is in use: {', '.join(used)}", "umount it, if it is the card")
        if self.octets < needed:
            raise ImageError(f"{self.path}: has {self.octets >> 20} MiB, and the image {needed >> 20}")
        if self._word("ro") == "1":
            raise ImageError(f"{self.path}: may only be read", "an SD card's adapter has a switch for that")
        # What is soldered to a board is mmcblk as well, and of type MMC.
        if self._word("removable") != "1" and self._word("device/type") != "SD":
            raise ImageError(f"{self.path}: {self.model or 'this disk'} is not removable", "a card reader's card is")
        if self.octets > LARGEST_GIB << 30:
            raise ImageError(f"{self.path}: has {self.octets >> 30} GiB, which no card of a box has")

    def opened(self, flags: int) -> BinaryIO:
        """Nobody else may have it at the same time, not even by a mount that was made since. Raises ImageError."""
        try:
            return os.fdopen(os.open(self.path, flags | os.O_EXCL), "r+b" if flags & os.O_RDWR else "rb", buffering=0)
        except OSError as error:
            hint = "umount it, if it is the card" if error.errno == errno.EBUSY else "as root: make flash"
            raise ImageError(f"{self.path}: cannot be opened: {error.strerror}", hint) from error

    def _used(self, users: Users) -> list[str]:
        """By what, of the whole disk and of its partitions."""
        parts = [self._about, *sorted(path.parent for path in self._about.glob("*/partition"))]
        names = [f"/dev/{part.name}" for part in parts]
        numbers = [(part / "dev").read_text().strip() for part in parts if (part / "dev").exists()]
        found = []
        for line in users.mounts.splitlines():
            place, _, source = line.partition(" - ")
            if place.split()[2] in numbers or source.split()[1] in names:
                found.append(f"mounted at {place.split()[4]}")
        found += [f"{line.split()[0]} is swap" for line in users.swaps.splitlines() if line.split()[0] in names]
        held = [holder.name for part in parts for holder in sorted((part / "holders").glob("*"))]
        return [*found, *(f"part of {name}" for name in held)]

    def _word(self, name: str) -> str:
        try:
            return (self._about / name).read_text().strip()
        except OSError:
            return ""


def flash(image: Path, checksums: Path, path: Path) -> None:
    """Ask, write it, and read it back. checksums: of what was built. Raises ImageError."""
    if not image.exists():
        raise ImageError(f"{image}: is not there", "make image builds it")
    if not sys.stdin.isatty():
        raise ImageError("nobody can be asked here: nothing was written", "run it at a terminal")
    if not path.exists() or not stat.S_ISBLK(path.stat().st_mode):
        raise ImageError(f"{path}: is no block device", "lsblk shows which there are")
    compare(image, checksums)
    users = Users(Path("/proc/self/mountinfo").read_text(), Path("/proc/swaps").read_text())
    write(image, Device(path.resolve()), users, input)


def compare(image: Path, checksums: Path) -> None:
    """Raises ImageError for an image of which the build did not come to its end, or that is another one since."""
    lines = checksums.read_text(errors="replace").splitlines() if checksums.exists() else []
    built = [line.split()[0] for line in lines if line.endswith(f"  {image.name}")]
    if not built:
        raise ImageError(f"{image}: was not built to its end", "make image builds it")
    if checksum.sha256(image) != built[0]:
        raise ImageError(f"{image}: is another one than was built", "make image builds it again")


def write(image: Path, device: Device, users: Users, ask: Callable[[str], str]) -> None:
    """The same, of a device. ask: a question to its answer. Raises ImageError: refused, or it reads back otherwise."""
    size = image.stat().st_size
    device.refuse(size, users)
    print(f"All that is on {device.path} ({device.model or 'a card'}, {device.octets / 1e9:.1f} GB) will be lost.")
    try:
        answer = ask(f"Type {device.path.name} to go on: ").strip()
    except EOFError:
        answer = ""
    except KeyboardInterrupt:
        raise ImageError("nothing was written") from None
    if answer != device.path.name:
        raise ImageError("nothing was written")
    hint = "what is on it now is no box: write it once more, or take another card"
    try:
        _copied(image, device, size)
        _compared(image, device)
    except OSError as error:
        raise ImageError(f"{device.path}: {error.strerror}", hint) from error
    except KeyboardInterrupt:
        raise ImageError(f"{device.path}: stopped before it was written and read back", hint) from None
    print(f"\r{device.path}: written, and read back. Take it out, put it into the box, and connect its power.")


def _copied(image: Path, device: Device, size: int) -> None:
    with image.open("rb") as source, device.opened(os.O_RDWR) as target:
        while octets := source.read(CHUNK):
            _all_written(target, octets)
            print(f"\r{source.tell() * 100 // size} %", end="", flush=True)
        os.fsync(target.fileno())
        os.posix_fadvise(target.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)  # what is read back comes from the card


def _all_written(target: BinaryIO, octets: bytes) -> None:
    rest = memoryview(octets)
    while rest:
        rest = rest[target.write(rest) :]


def _compared(image: Path, device: Device) -> None:
    with image.open("rb") as source, device.opened(os.O_RDONLY) as target:
        while octets := source.read(CHUNK):
            if _read(target, len(octets)) != octets:
                hint = "the card is worn out, or not as large as it says"
                raise ImageError(f"{device.path}: reads back something else before octet {source.tell()}", hint)


def _read(target: BinaryIO, size: int) -> bytes:
    found = b""
    while len(found) < size and (octets := target.read(size - len(found))):
        found += octets
    return found
