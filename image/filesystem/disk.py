"""Disk image without loop devices or root: same files, same octets."""

import errno
import os
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from image.description import Disk, Partition
from image.tool import run

MIB = 1 << 20
SECTOR = 512
FIRST_MIB = 4  # begin of the first partition, aligned to the erase blocks of any card
LOGICAL_MIB = 1  # room before each logical partition for its table
FIRST_LOGICAL = 5
HASH_SEED = "6d0c3a52-6a3e-4b0e-9c1a-0f6f6c2d5eed"
CHUNK = 1 << 20
# Features that U-Boot's reader does not support.
NO_FEATURES = "^metadata_csum_seed,^orphan_file"


class PartitionPlace(NamedTuple):
    """Partition with its begin, in MiB from the begin of the card."""

    partition: Partition
    start_mib: int

    @property
    def offset(self) -> int:
        return self.start_mib * MIB


def places(disk: Disk) -> list[PartitionPlace]:
    """Return all partitions except the extended one, which begins LOGICAL_MIB before the first logical one."""
    found, at_mib = [], FIRST_MIB
    for partition in disk.partitions:
        at_mib += LOGICAL_MIB if partition.number >= FIRST_LOGICAL else 0
        found.append(PartitionPlace(partition, at_mib))
        at_mib += partition.size_mib
    return found


def table(disk: Disk) -> str:
    """Return the partition table as a script for sfdisk(8)."""
    kinds = {"fat": "c", "root": "83", "raw": "da", "data": "83"}
    lines = ["label: dos", f"label-id: {disk.label_id:#010x}", "unit: sectors"]
    extended = 0
    for place in places(disk):
        start, size = (mib * MIB // SECTOR for mib in (place.start_mib, place.partition.size_mib))
        if place.partition.number == FIRST_LOGICAL:
            extended = start - LOGICAL_MIB * MIB // SECTOR
            lines.append(f"4 : start={extended}, size={disk.size_mib * MIB // SECTOR - extended}, type=f")
        bootable = ", bootable" if place.partition.kind == "fat" else ""
        lines.append(
            f"{place.partition.number} : start={start}, size={size}, type={kinds[place.partition.kind]}{bootable}"
        )
    return "\n".join(lines) + "\n"


def make(disk: Disk, parts: Mapping[str, Path], target: Path) -> None:
    """Make a card from file systems by name of their partition; other partitions stay empty.

    The target is complete or unchanged. Raises ImageError if a tool fails.
    """
    new = target.with_name(f"{target.name}.new")
    new.unlink(missing_ok=True)
    with new.open("wb") as file:
        file.truncate(disk.size_mib * MIB)
    run(["sfdisk", "-q", "--no-reread", "--no-tell-kernel", new], given=table(disk))
    with new.open("r+b") as card:
        for place in places(disk):
            if place.partition.name in parts:
                _copy(parts[place.partition.name], card.fileno(), place.offset)
    new.rename(target)


def make_fat(partition: Partition, folder: Path, target: Path, epoch: int) -> None:
    """Make a FAT with the files of a folder. Raises ImageError if a tool fails."""
    _empty(partition, target)
    run(["mkfs.vfat", "--invariant", "-F", "32", "-n", partition.name.upper(), "-i", partition.id, target])
    paths = sorted(folder.rglob("*"))
    for path in paths:
        os.utime(path, (epoch, epoch))
    for path in paths:
        place = f"::{path.relative_to(folder).as_posix()}"
        words: list[str | Path] = ["mmd"] if path.is_dir() else ["mcopy", "-m"]
        files = [place] if path.is_dir() else [path, place]
        run([*words, "-i", target, *files], environment={"MTOOLS_SKIP_CHECK": "1"})


def make_ext4(partition: Partition, tree: Path | None, target: Path, epoch: int, tools: Path, journal: bool) -> None:
    """Make an ext4 with the files of a tar.

    tools  folder of an unpacked e2fsprogs 1.47.1 or newer. Older ones read no tar, and give each inode the current
           time in spite of SOURCE_DATE_EPOCH.

    Raises ImageError if mke2fs fails.
    """
    _empty(partition, target)
    features = NO_FEATURES if journal else f"{NO_FEATURES},^has_journal"
    label = partition.kind  # not the name, because both slots are equal
    options = f"hash_seed={HASH_SEED},lazy_itable_init=0,lazy_journal_init=0,root_owner=0:0"
    words: list[str | Path] = [
        "-q",
        "-F",
        "-t",
        "ext4",
        "-b",
        "4096",
        "-m",
        "1",
        "-L",
        label,
        "-U",
        partition.id,
        "-E",
        options,
        "-O",
        features,
    ]
    files: list[str | Path] = ["-d", tree] if tree else []
    loader = next(tools.glob("usr/lib/*/ld-linux*.so.*"))
    run(
        [loader, "--library-path", loader.parent, tools / "usr/sbin/mke2fs", *words, *files, target],
        environment={"SOURCE_DATE_EPOCH": str(epoch), "MKE2FS_CONFIG": str(tools / "etc/mke2fs.conf")},
    )


def _empty(partition: Partition, target: Path) -> None:
    target.unlink(missing_ok=True)
    with target.open("wb") as file:
        file.truncate(partition.size_mib * MIB)


def _copy(source: Path, card: int, offset: int) -> None:
    """Copy a file without its holes to an offset of the card."""
    with source.open("rb") as file:
        at, size = 0, os.fstat(file.fileno()).st_size
        while at < size:
            try:
                at = os.lseek(file.fileno(), at, os.SEEK_DATA)
            except OSError as error:
                if error.errno == errno.ENXIO:  # the rest of the file is a hole
                    return
                raise
            end = os.lseek(file.fileno(), at, os.SEEK_HOLE)
            while at < end:
                octets = os.pread(file.fileno(), min(CHUNK, end - at), at)
                os.pwrite(card, octets, offset + at)
                at += len(octets)
