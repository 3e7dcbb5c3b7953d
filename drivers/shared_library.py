"""Whether a shared library can be loaded by this very program, told from its first octets without loading it."""

import os
from functools import cache
from struct import Struct
from typing import NamedTuple

from board.errors import BlockedError

# Elf32_Ehdr and Elf64_Ehdr begin alike: magic, class, data, version, ABI, padding, type, machine (System V ABI, 4.1).
_HEADER = Struct("<4sBB10xHH")
_MAGIC = b"\x7fELF"
_SHARED = 3  # ET_DYN

MACHINES = {3: "i386", 40: "arm", 62: "x86-64", 183: "aarch64", 243: "riscv64"}  # e_machine
BITS = {1: 32, 2: 64}  # EI_CLASS

# Where one is looked for that has no path: beside captain.toml, where a box has what lay on its card, and where makers'
# packages put them.
FOLDERS = ("lib", "/usr/local/lib", "/usr/lib")

Identity = tuple[int, ...] | None


class Architecture(NamedTuple):
    """What an ELF file runs on: EI_CLASS, EI_DATA and e_machine."""

    class_: int
    data: int
    machine: int

    def __str__(self) -> str:
        return f"{MACHINES.get(self.machine, f'machine {self.machine}')}, {BITS.get(self.class_, 0)} bit"


AARCH64 = Architecture(2, 1, 183)


def located(name: str) -> str:
    """The path of a library that is named by its file alone: the first of FOLDERS that has it. Raises BlockedError."""
    if "/" in name:
        return name
    path = next((path for folder in FOLDERS if os.path.exists(path := f"{folder}/{name}")), "")
    if not path:
        hint = "install it in one of them, on a box into lib/ of its card, or name its path: option library"
        raise BlockedError(f"{name}: is in none of {', '.join(FOLDERS)}", hint)
    return path


def check(path: str, ours: Architecture | None = None) -> None:
    """Raises BlockedError, with what to do: absent, not readable, no shared library, of another architecture.

    ours  what it is to run on; without, that of this program.
    """
    try:
        ours, octets = ours or own_architecture(), _head(path)
    except OSError as error:
        hint = "install it there, or say where it is: option library"
        raise BlockedError(f"{path}: cannot be opened: {error.strerror}", hint) from error
    found = _architecture(octets)
    if found is None:
        raise BlockedError(f"{path}: is no shared library: it begins with {octets[:4].hex(' ') or 'nothing'}")
    if found != ours:
        raise BlockedError(f"{path}: is built for {found}; the station runs as {ours}", f"install that for {ours}")


@cache
def own_architecture() -> Architecture:
    """Of the program that runs: with a 64 bit kernel it may still be a 32 bit one. Raises OSError."""
    return Architecture(*_fields(_head("/proc/self/exe"))[:3])


def identity(path: str) -> Identity:
    """What changes when another file is put in a library's place; None where there is none."""
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
    """None for what is no shared library. Of another octet order the type is read as 0x0300 and is taken as well."""
    if len(octets) < _HEADER.size or octets[:4] != _MAGIC:
        return None
    class_, data, machine, kind = _fields(octets)
    if data == 2:  # ELFDATA2MSB
        machine, kind = (int.from_bytes(number.to_bytes(2, "little"), "big") for number in (machine, kind))
    return Architecture(class_, data, machine) if kind == _SHARED else None
