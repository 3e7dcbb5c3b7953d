"""Compares a finished card with its description."""

import re
import stat
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from board.runtime import boot_counters
from image.card import build
from image.description import Description, Partition
from image.errors import ImageError
from image.filesystem import disk
from image.filesystem.ext4 import FileSystem
from image.parts import kernel, slot_names
from image.project import version
from image.verify import beside as verify_beside
from image.verify import boot, bundle
from image.verify import slot as verify_slot
from image.verify import words as verify_words

MIB = disk.MIB
CHUNK = 16 * MIB
WANTED = (
    "boot/Image", "boot/initrd", "usr/lib/captain/captain", "usr/lib/systemd/systemd", "usr/sbin/chronyd",
    "usr/sbin/nft", "usr/sbin/sshd", "usr/bin/rauc", "usr/sbin/e2fsck", "usr/lib/clock-epoch",
    "etc/nftables.conf", "etc/fstab", "etc/chrony/chrony.conf", "usr/lib/systemd/system/captain.service",
    "etc/rauc/keyring.pem", slot_names.PATH,
)  # fmt: skip
UNWANTED = ("etc/apt", "var/lib/apt", "var/lib/dpkg", "etc/ssh/ssh_host_*", "root/.ssh", "home/operator/.ssh")
# Exceptions of the code that reads accounts, programs and archives, if their octets were changed.
DAMAGED = (ValueError, TypeError, LookupError, EOFError, struct.error)


class Check(NamedTuple):
    """Check with its trouble, which is empty if it passed."""

    check: str
    trouble: str = ""

    def __str__(self) -> str:
        return f"{'FAILED' if self.trouble else 'ok':6}  {self.check}" + (f": {self.trouble}" if self.trouble else "")


class FinishedCard:
    """Image file of a card, with the checks of it.

    built   folder of the build: unpacked e2fsprogs, unpacked packages of the card, and the early boot.
    secret  octets that show a copy of the update key; empty for a key in hardware.
    made    files of the same build beside the card; None: not checked.
    """

    def __init__(
        self,
        description: Description,
        image: Path,
        built: Path,
        secret: bytes = b"",
        made: build.CardBuild | None = None,
    ) -> None:
        self._description = description
        self._image = image
        self._built = built
        self._tools = built / "tools"
        self._unpacked = built / "kernel/tree"
        self._early = built / "early/initrd"
        self._secret = secret
        self._made = made
        self._places = {place.partition.name: place for place in disk.places(description.disk)}

    def rows(self) -> Iterator[Check]:
        """Yield every check. Raises ImageError if no card was built."""
        for path in (self._image, self._tools, self._unpacked, self._early):
            if not path.exists():
                raise ImageError(f"{path}: is not there", "make image builds it")
        if self._made:
            yield from (Check(*check) for check in verify_beside.checksums(self._made))
        yield self._table()
        if self._image.stat().st_size < self._description.disk.size_mib * MIB:
            return
        yield self._counters()
        for name in ("root-a", "root-b", "data"):
            yield self._file_system(name)
        yield self._same_slots()
        for what, part in (
            ("the boot partition", self._boot_partition),
            ("the slot", self._slot),
            ("the data partition", self._data),
        ):
            try:
                yield from part()
            except ImageError as error:  # a damaged file system does not keep the others from being checked
                first, _, rest = str(error).partition("\n")  # the command, and its output
                yield Check(f"{what} can be read", "; ".join((rest or first).splitlines()))
            except DAMAGED as error:
                yield Check(f"{what} can be read", f"a file in it is damaged: {error!r}")
        yield from self._unwanted_words(self._known_keys())

    def _table(self) -> Check:
        plan = self._description.disk
        head = _read(self._image, 0, disk.SECTOR)
        found = int.from_bytes(head[440:444], "little")
        size = self._image.stat().st_size
        if size != plan.size_mib * MIB:
            return Check("the table of partitions", f"the image has {size} octets, not {plan.size_mib} MiB")
        if found != plan.label_id:
            return Check("the table of partitions", f"its id is {found:#010x}, not {plan.label_id:#010x}")
        for name, place in self._places.items():
            if place.partition.number <= 4:
                row = head[446 + 16 * (place.partition.number - 1) :][:16]
            else:  # the table of a logical partition, before it
                row = _read(self._image, place.offset - disk.LOGICAL_MIB * MIB, disk.SECTOR)[446:462]
            start, sectors = int.from_bytes(row[8:12], "little"), int.from_bytes(row[12:16], "little")
            base = (
                0
                if place.partition.number <= 4
                else place.offset // disk.SECTOR - disk.LOGICAL_MIB * MIB // disk.SECTOR
            )
            if (base + start, sectors) != (place.offset // disk.SECTOR, place.partition.size_mib * MIB // disk.SECTOR):
                return Check("the table of partitions", f"{name} lies at sector {base + start}, {sectors} long")
        return Check("the table of partitions")

    def _counters(self) -> Check:
        place = self._places["state"]
        octets = _read(self._image, place.offset, place.partition.size_mib * MIB)
        wanted = boot_counters.blank().ljust(len(octets), b"\0")
        if octets == wanted:
            return Check("the boot counters")
        pairs = zip(boot_counters.copies_in(octets), boot_counters.copies_in(wanted), strict=True)
        for copy, pair in enumerate(pairs, 1):
            one, other = map(boot_counters.unpacked, pair)
            if one != other:
                return Check("the boot counters", f"copy {copy} is {one} and not {other}")
        return Check("the boot counters", "there is something beside both copies")

    def _boot_partition(self) -> Iterator[Check]:
        place = self._places["boot"]
        checks = boot.checks(self._description, f"{self._image}@@{place.offset}", kernel.Kernel(self._unpacked))
        yield from (Check(*check) for check in checks)
        serial = _read(self._image, place.offset + 67, 4)[::-1].hex()
        other = f"{serial}, not {place.partition.id}"
        yield Check("the FAT's serial number", "" if serial == place.partition.id else other)

    def _file_system(self, name: str) -> Check:
        place = self._places[name]
        octets = _read(self._image, place.offset + 1024, 1024)
        found = f"{int.from_bytes(octets[104:120], 'big'):032x}"
        wanted = place.partition.id.replace("-", "")
        what = f"the file system {name}"
        return Check(what, "" if found == wanted else f"its UUID is {found}, not {wanted}")

    def _same_slots(self) -> Check:
        what = "both slots are the same"
        one, other = self._places["root-a"], self._places["root-b"]
        size = one.partition.size_mib * MIB
        with self._image.open("rb") as file, self._image.open("rb") as twin:
            for at in range(0, size, CHUNK):
                file.seek(one.offset + at)
                twin.seek(other.offset + at)
                if file.read(min(CHUNK, size - at)) != twin.read(min(CHUNK, size - at)):
                    return Check(what, f"they differ after octet {at}")
        return Check(what)

    def _data(self) -> Iterator[Check]:
        with FileSystem(self._image, self._places["data"].offset, self._tools) as data:
            kept = sorted(data.paths())
        yield Check("nothing is kept on the data partition", f"there is {kept[0]}" if kept else "")

    def _slot(self) -> Iterator[Check]:
        with FileSystem(self._image, self._places["root-a"].offset, self._tools) as slot:
            yield from self._slot_rows(slot)

    def _slot_rows(self, slot: FileSystem) -> Iterator[Check]:
        there = set(slot.paths())
        missing = [path for path in WANTED if path not in there]
        yield Check("files of the slot", f"{missing} are not there" if missing else "")
        for pattern in UNWANTED:
            found = [path for path in there if re.fullmatch(pattern.replace("*", "[^/]*"), path)]
            yield Check(f"no {pattern}", f"there is {found[0]}" if found else "")
        identity = slot.read("etc/machine-id").strip()
        yield Check("no machine-id", f"it is {identity.decode()}" if identity else "")
        yield from self._packages(there)
        yield from (Check(*check) for check in verify_slot.checks(slot))
        octets = {"boot/Image": kernel.Kernel(self._unpacked).image, "boot/initrd": self._early}
        read = {path: source.read_bytes() for path, source in octets.items()}
        yield from (Check(*check) for check in verify_slot.composed(slot, self._description, read))
        if self._made:
            keyring = slot.read("etc/rauc/keyring.pem")
            checks = bundle.checks(self._description, version(), self._made.bundle, keyring)
            yield from (Check(*check) for check in checks)
            beside = verify_beside.agreeing(self._made, self._built, there)
            yield from (Check(*check) for check in beside)
        words = [line.split(":") for line in slot.read("etc/shadow").decode().splitlines()]
        able = [row[0] for row in words if row[1] not in ("*", "!", "!*")]
        yield Check("no user has a password", f"{able} have" if able else "")
        fstab = slot.read("etc/fstab").decode()
        yield Check(
            "the mounts",
            ""
            if f"PARTUUID={self._description.disk.partuuid('boot')} " in fstab
            else "the boot partition is not named",
        )
        unreplaced = [
            path
            for path in sorted(there)
            if path.startswith("etc/") and slot.is_small(path) and boot.WORD.search(slot.read(path))
        ]
        yield Check("no word is left open", f"in {unreplaced}" if unreplaced else "")
        mode = slot.mode("usr/lib/captain/captain")
        yield Check(
            "everybody may run captain", "" if stat.S_IMODE(mode) == 0o755 else f"its mode is {stat.S_IMODE(mode):o}"
        )

    def _packages(self, there: set[str]) -> Iterator[Check]:
        for group in (self._description.packages.install, self._description.packages.unpack):
            missing = [name for name in group if f"usr/share/doc/{name}" not in there]
            yield Check("packages and their licences", f"{missing} are not there" if missing else "")

    def _unwanted_words(self, known_keys: bytes = b"") -> Iterator[Check]:
        words = verify_words.unwanted(self._secret, known_keys)
        found = verify_words.places(self._image, words)
        for what in (word.what for word in words):
            place = self._where(found[what]) if what in found else ""
            yield Check(f"{what} is nowhere", f"at octet {found[what]}, {place}" if what in found else "")

    def _known_keys(self) -> bytes:
        try:
            with FileSystem(self._image, self._places["root-a"].offset, self._tools) as slot:
                paths = [path for path in slot.paths() if verify_words.TESTED.fullmatch(path) and slot.size(path)]
                return b"".join(map(slot.read, paths))
        except (ImageError, *DAMAGED):  # _slot() reports it
            return b""

    def _where(self, offset: int) -> str:
        for name, place in self._places.items():
            if place.offset <= offset < place.offset + place.partition.size_mib * MIB:
                return f"in {name}{self._file_at(place.partition, offset - place.offset)}"
        return "in no partition"

    def _file_at(self, partition: Partition, offset: int) -> str:
        if partition.kind != "root":
            return ""
        try:
            with FileSystem(self._image, self._places[partition.name].offset, self._tools) as slot:
                return f", {slot.owner(offset)}"
        except ImageError:
            return ", which cannot be read"


def _read(path: Path, offset: int, size: int) -> bytes:
    with path.open("rb") as file:
        file.seek(offset)
        return file.read(size)
