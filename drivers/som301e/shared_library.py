"""Check of a shared library's architecture by its first octets, without loading it."""

import os
from functools import cache
from struct import Struct
from typing import NamedTuple

from board.runtime.errors import BlockedError

# Elf32_Ehdr and Elf64_Ehdr begin alike: magic, class, data, version, ABI, padding, type, machine (System V ABI, 4.1).
_HEADER = Struct("<4sBB10xHH")
_MAGIC = b"\x7fELF"
_SHARED = 3  # e_type of a shared library: ET_DYN

MACHINES = {3: "i386", 40: "arm", 62: "x86-64", 183: "aarch64", 243: "riscv64"}  # architecture by e_machine
BITS = {1: 32, 2: 64}  # word length by EI_CLASS

# Folders to search for a library named without a path. The first is beside captain.toml: on a box it has the files that
# were in lib/ of the SD card. Vendors' packages install into the others.
FOLDERS = ("lib", "/usr/local/lib", "/usr/lib")

Identity = tuple[int, ...] | None


class Architecture(NamedTuple):
    """Architecture of an ELF file: EI_CLASS, EI_DATA and e_machine."""

    class_: int
    data: int
    machine: int

    def __str__(self) -> str:
        return f"{MACHINES.get(self.machine, f'machine {self.machine}')}, {BITS.get(self.class_, 0)} bit"


AARCH64 = Architecture(2, 1, 183)


def located(name: str) -> str:
    """Return the path of a library: a name with a slash unchanged, otherwise the file in the first of FOLDERS.

    Raises BlockedError if none of FOLDERS contains it.
    """
    if "/" in name:
        return name
    path = next((path for folder in FOLDERS if os.path.exists(path := f"{folder}/{name}")), "")
    if not path:
        hint = "install it in one of them, on a box into lib/ of its card, or name its path: option library"
        raise BlockedError(f"{name}: not found in {', '.join(FOLDERS)}", hint)
    return path


def check(path: str, ours: Architecture | None = None) -> None:
    """Check the library's file.

    ours  required architecture; None: that of this program.

    Raises BlockedError, with a remedy, if it is absent, unreadable, not a shared library, or of another architecture.
    """
    try:
        ours, octets = ours or own_architecture(), _head(path)
    except OSError as error:
        hint = "install it there, or say where it is: option library"
        raise BlockedError(f"{path}: cannot be opened: {error.strerror}", hint) from error
    found = _architecture(octets)
    if found is None:
        raise BlockedError(f"{path}: not a shared library: it begins with {octets[:4].hex(' ') or 'nothing'}")
    if found != ours:
        raise BlockedError(f"{path}: is built for {found}; the station runs as {ours}", f"install that for {ours}")


@cache
def own_architecture() -> Architecture:
    """Return the architecture of the running program, which may be 32-bit even with a 64-bit kernel.

    Raises OSError if /proc/self/exe cannot be read.
    """
    return Architecture(*_fields(_head("/proc/self/exe"))[:3])


def identity(path: str) -> Identity:
    """Return device, inode, size and time of a file, which change if it is replaced; None if it does not exist."""
    try:
        found = os.stat(path)
    except OSError:
        return None
    return found.st_dev, found.st_ino, found.st_size, found.st_mtime_ns


def _head(path: str) -> bytes:
    with open(path, "rb") as file:
        return file.read(_HEADER.size)


def _fields(octets: bytes) -> tuple[int, int, int, int]:
    _, class_, data, kind, machine = _HEADER.unpack(octets)
    return class_, data, machine, kind


def _architecture(octets: bytes) -> Architecture | None:
    """Return the architecture in an ELF header; None if it is not of a shared library. Handles both octet orders."""
    if len(octets) < _HEADER.size or octets[:4] != _MAGIC:
        return None
    class_, data, machine, kind = _fields(octets)
    if data == 2:  # EI_DATA is ELFDATA2MSB: the numbers are big-endian
        machine, kind = (int.from_bytes(number.to_bytes(2, "little"), "big") for number in (machine, kind))
    return Architecture(class_, data, machine) if kind == _SHARED else None
