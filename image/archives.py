"""The archives of a program that PyInstaller has frozen, read and written without it: whole entries go from one to
another as they are, whichever Python they were compiled by.

Source: PyInstaller 6.22, archive/writers.py and archive/readers.py.
"""

import marshal
import struct
import zlib
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from image.bytecode import Module
from image.errors import ImageError

MODULES = "PYZ.pyz"
SCRIPT = "__main__"
SECTION = "pydata"  # of the program, which holds the package

# A package: octets of the entries, rows about them, and an end.
_MAGIC = b"MEI\014\013\012\013\016"
_END = struct.Struct("!8s I I I I 64s")  # magic, size of the package, place and size of the rows, Python, its library
_ROW = struct.Struct("!I I I I B c")  # size of the row, place, size, size when unpacked, is it compressed, kind
_ALIGNED = 16
# An archive of modules: magic, that of the bytecode, place of the rows; then up to the first module nothing.
_MODULES_MAGIC = b"PYZ\0"
_MODULES_HEAD = struct.Struct("!4s 4s I 5x")
_MODULE, _PACKAGE = 0, 1


class Entry(NamedTuple):
    """A file in a package. octets: as they are stored; size: of them when unpacked."""

    name: str
    kind: bytes
    octets: bytes
    size: int
    is_compressed: bool = False


class Package(NamedTuple):
    """What a program carries. python: 313 for 3.13; library: the name of its file."""

    entries: list[Entry]
    python: int
    library: bytes

    def entry(self, name: str) -> Entry:
        """Raises KeyError."""
        return {entry.name: entry for entry in self.entries}[name]

    def replaced(self, changes: Iterable[Entry]) -> "Package":
        """With other entries in place of those of the same name."""
        by_name = {entry.name: entry for entry in changes}
        return self._replace(entries=[by_name.get(entry.name, entry) for entry in self.entries])


def stored(name: str, kind: bytes, content: bytes) -> Entry:
    return Entry(name, kind, content, len(content))


def compressed(name: str, kind: bytes, content: bytes) -> Entry:
    return Entry(name, kind, zlib.compress(content, 9), len(content), True)


def read(program: bytes) -> Package:
    """The package at a program's end. Raises ImageError: there is none."""
    end = program.rfind(_MAGIC)
    if end < 0:
        raise ImageError("the frozen program carries no package", "PyInstaller's form may have changed")
    _, size, at, rows_size, python, library = _END.unpack_from(program, end)
    package = program[end + _END.size - size : end]
    rows, found = package[at : at + rows_size], []
    while rows:
        length, place, stored_size, whole, is_compressed, kind = _ROW.unpack_from(rows)
        name = rows[_ROW.size : length].rstrip(b"\0").decode()
        found.append(Entry(name, kind, package[place : place + stored_size], whole, bool(is_compressed)))
        rows = rows[length:]
    return Package(found, python, library.rstrip(b"\0"))


def written(package: Package) -> bytes:
    """What read() reads, without the program."""
    octets, rows = bytearray(), bytearray()
    for entry in package.entries:
        name = entry.name.encode() + b"\0"
        length = -(-(_ROW.size + len(name)) // _ALIGNED) * _ALIGNED
        head = (length, len(octets), len(entry.octets), entry.size, entry.is_compressed, entry.kind)
        rows += (_ROW.pack(*head) + name).ljust(length, b"\0")
        octets += entry.octets
    size = len(octets) + len(rows) + _END.size
    end = _END.pack(_MAGIC, size, len(octets), len(rows), package.python, package.library)
    return bytes(octets + rows + end)


def with_modules(archive: bytes, modules: Sequence[Module]) -> bytes:
    """An archive of modules with further ones behind its own. Raises ImageError: it has one of that name."""
    magic, bytecode, at = _MODULES_HEAD.unpack_from(archive)
    if magic != _MODULES_MAGIC:
        raise ImageError("the frozen program's modules are not in PyInstaller's form", "it may have changed")
    rows = marshal.loads(archive[at:])
    known = {name for name, _ in rows}
    octets = bytearray(archive[:at])
    for module in modules:
        if module.name in known:
            raise ImageError(f"{module.name}: was frozen as if it were not ours")
        code = zlib.compress(module.code, 9)
        rows.append((module.name, (_PACKAGE if module.is_package else _MODULE, len(octets), len(code))))
        octets += code
    head = _MODULES_HEAD.pack(magic, bytecode, len(octets))
    return bytes(head + octets[len(head) :] + marshal.dumps(rows))


def module_names(archive: bytes) -> list[str]:
    """Of an archive of modules."""
    _, _, at = _MODULES_HEAD.unpack_from(archive)
    return [name for name, _ in marshal.loads(archive[at:])]
