"""Flashes a card after a confirmation, and reads it back."""

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
LARGEST_GIB = 512  # larger disks are a computer's, not a card


class Users(NamedTuple):
    """Texts of the kernel about devices in use: /proc/self/mountinfo and /proc/swaps."""

    mounts: str
    swaps: str = ""


class BlockDevice:
    """Block device by its description in sysfs. sys_folder: replaced in tests."""

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
        """Check the device. Raises ImageError unless it is a whole disk, large enough, unused, not a computer's own."""
        if not (self._about / "size").exists():
            raise ImageError(f"{self.path}: not a block device", "lsblk shows which there are")
        if (self._about / "partition").exists():
            raise ImageError(f"{self.path}: is a partition", "name the whole card, without its last number")
        used = self._used(users)
        if used:
            raise ImageError(f"{self.path}: is in use: {', '.join(used)}", "umount it, if it is the card")
        if self.octets < needed:
            raise ImageError(f"{self.path}: has {self.octets >> 20} MiB, and the image {needed >> 20}")
        if self._word("ro") == "1":
            raise ImageError(f"{self.path}: may only be read", "an SD card's adapter has a switch for that")
        # A chip soldered to a board is mmcblk as well; its type is MMC, not SD.
        if self._word("removable") != "1" and self._word("device/type") != "SD":
            raise ImageError(f"{self.path}: {self.model or 'this disk'} is not removable", "a card reader's card is")
        if self.octets > LARGEST_GIB << 30:
            raise ImageError(f"{self.path}: has {self.octets >> 30} GiB, which no card of a box has")

    def opened(self, flags: int) -> BinaryIO:
        """Open it exclusively, against mounts too. Raises ImageError if it is in use or not permitted."""
        try:
            return os.fdopen(os.open(self.path, flags | os.O_EXCL), "r+b" if flags & os.O_RDWR else "rb", buffering=0)
        except OSError as error:
            hint = "umount it, if it is the card" if error.errno == errno.EBUSY else "as root: make flash"
            raise ImageError(f"{self.path}: cannot be opened: {error.strerror}", hint) from error

    def _used(self, users: Users) -> list[str]:
        """Return the uses of the disk and its partitions, in words."""
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
    """Ask for a confirmation, write a card, and read it back. checksums: of the built files.

    Raises ImageError without image, terminal or block device, without confirmation, or if the card reads back
    differently.
    """
    if not image.exists():
        raise ImageError(f"{image}: is not there", "make image builds it")
    if not sys.stdin.isatty():
        raise ImageError("standard input is not a terminal: nothing was written", "run it at a terminal")
    if not path.exists() or not stat.S_ISBLK(path.stat().st_mode):
        raise ImageError(f"{path}: not a block device", "lsblk shows which there are")
    compare(image, checksums)
    users = Users(Path("/proc/self/mountinfo").read_text(), Path("/proc/swaps").read_text())
    write(image, BlockDevice(path.resolve()), users, input)


def compare(image: Path, checksums: Path) -> None:
    """Check an image. Raises ImageError if its build was not finished, or if it was changed since."""
    lines = checksums.read_text(errors="replace").splitlines() if checksums.exists() else []
    built = [line.split()[0] for line in lines if line.endswith(f"  {image.name}")]
    if not built:
        raise ImageError(f"{image}: the build of this image was not completed", "run make image")
    if checksum.sha256(image) != built[0]:
        raise ImageError(f"{image}: has changed since it was built", "run make image again")


def write(image: Path, device: BlockDevice, users: Users, ask: Callable[[str], str]) -> None:
    """Write a checked image to a device, as flash(). ask: shows a question, returns the answer. Raises ImageError."""
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
    hint = "the card is incomplete: write it again, or use another card"
    try:
        _copied(image, device, size)
        _compared(image, device)
    except OSError as error:
        raise ImageError(f"{device.path}: {error.strerror}", hint) from error
    except KeyboardInterrupt:
        raise ImageError(f"{device.path}: stopped before it was written and read back", hint) from None
    print(f"\r{device.path}: written, and read back. Take it out, put it into the box, and connect its power.")


def _copied(image: Path, device: BlockDevice, size: int) -> None:
    with image.open("rb") as source, device.opened(os.O_RDWR) as target:
        while octets := source.read(CHUNK):
            _all_written(target, octets)
            print(f"\r{source.tell() * 100 // size} %", end="", flush=True)
        os.fsync(target.fileno())
        os.posix_fadvise(target.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)  # so that the card is read, not the cache


def _all_written(target: BinaryIO, octets: bytes) -> None:
    rest = memoryview(octets)
    while rest:
        rest = rest[target.write(rest) :]


def _compared(image: Path, device: BlockDevice) -> None:
    with image.open("rb") as source, device.opened(os.O_RDONLY) as target:
        while octets := source.read(CHUNK):
            if _read(target, len(octets)) != octets:
                hint = "the card is worn out, or smaller than it reports"
                raise ImageError(f"{device.path}: the octets before {source.tell()} differ from those written", hint)


def _read(target: BinaryIO, size: int) -> bytes:
    found = b""
    while len(found) < size and (octets := target.read(size - len(found))):
        found += octets
    return found
