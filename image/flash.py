"""Writes an image to a card, after a question that cannot be answered by accident."""

import os
import stat
import sys
from pathlib import Path

from image.errors import ImageError

CHUNK = 4 << 20
LARGEST_GIB = 512  # a disk of a computer has more


class Device:
    """A block device, as the kernel tells of it. sys: for tests."""

    def __init__(self, path: Path, sys_folder: Path = Path("/sys/class/block")) -> None:
        self.path = path
        self._about = sys_folder / path.name

    @property
    def octets(self) -> int:
        return int(self._word("size") or 0) * 512

    @property
    def model(self) -> str:
        return " ".join(
            word
            for word in (self._word("device/vendor"), self._word("device/model"), self._word("device/name"))
            if word
        )

    def refuse(self, needed: int, mounts: str) -> None:
        """Raises ImageError: it is no whole disk, too small, in use, or may well be a computer's own."""
        if not (self._about / "size").exists():
            raise ImageError(f"{self.path}: is no block device", "lsblk shows which there are")
        if (self._about / "partition").exists():
            raise ImageError(f"{self.path}: is a partition", "name the whole card, without its last number")
        used = [line.split()[1] for line in mounts.splitlines() if line.startswith(str(self.path))]
        if used:
            raise ImageError(f"{self.path}: is in use: mounted at {', '.join(used)}", "umount it, if it is the card")
        if self.octets < needed:
            raise ImageError(f"{self.path}: has {self.octets >> 20} MiB, and the image {needed >> 20}")
        if self._word("removable") != "1" and not self.path.name.startswith("mmcblk"):
            raise ImageError(f"{self.path}: {self.model or 'this disk'} is not removable", "a card reader's card is")
        if self.octets > LARGEST_GIB << 30:
            raise ImageError(f"{self.path}: has {self.octets >> 30} GiB, which no card of a box has")

    def _word(self, name: str) -> str:
        try:
            return (self._about / name).read_text().strip()
        except OSError:
            return ""


def write(image: Path, path: Path) -> None:
    """Write it, and read it back. Raises ImageError."""
    device = Device(path)
    size = image.stat().st_size
    device.refuse(size, Path("/proc/mounts").read_text())
    print(f"All that is on {path} ({device.model}, {device.octets / 1e9:.1f} GB) will be lost.")
    if not sys.stdin.isatty() or input(f"Type {path.name} to go on: ").strip() != path.name:
        raise ImageError("nothing was written")
    if not stat.S_ISBLK(path.stat().st_mode):
        raise ImageError(f"{path}: is no block device")
    with image.open("rb") as source, path.open("wb", buffering=0) as target:
        while octets := source.read(CHUNK):
            target.write(octets)
            print(f"\r{source.tell() * 100 // size} %", end="", flush=True)
        os.fsync(target.fileno())
        os.posix_fadvise(target.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)
    with image.open("rb") as source, path.open("rb", buffering=0) as target:
        while octets := source.read(CHUNK):
            if target.read(len(octets)) != octets:
                raise ImageError(f"{path}: reads back something else before {source.tell()}", "the card is worn out")
    print("\nwritten, and read back")
