"""PyInstaller's archives, read and written without PyInstaller.

Whole entries move from one archive to another unchanged, whichever Python compiled them.

Source: PyInstaller 6.22, archive/writers.py and archive/readers.py.
"""

import marshal
import struct
import zlib
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from image.errors import ImageError
from image.program.contents.bytecode import OwnModule

MODULES = "PYZ.pyz"
SCRIPT = "__main__"
SECTION = "pydata"  # section of the program that holds the package

# A package consists of the entries' octets, a table of rows about them, and an end.
_MAGIC = b"MEI\014\013\012\013\016"
_END = struct.Struct("!8s I I I I 64s")  # magic, size of the package, offset and size of the table, Python, its library
_ROW = struct.Struct("!I I I I B c")  # size of the row, offset, size, unpacked size, is it compressed, kind
_ALIGNED = 16
# An archive of modules: magic, magic of the byte code, offset of the table, unused octets.
_MODULES_MAGIC = b"PYZ\0"
_MODULES_HEAD = struct.Struct("!4s 4s I 5x")
_MODULE, _PACKAGE = 0, 1


class Entry(NamedTuple):
    """File in a package. octets: as stored; size: number of octets when unpacked."""

    name: str
    kind: bytes
    octets: bytes
    size: int
    is_compressed: bool = False


class Package(NamedTuple):
    """Package in a program. python: 313 for 3.13; library: name of the interpreter's shared library."""

    entries: list[Entry]
    python: int
    library: bytes

    def entry(self, name: str) -> Entry:
        """Return an entry by its name. Raises KeyError for an unknown name."""
        return {entry.name: entry for entry in self.entries}[name]

    def replaced(self, changes: Iterable[Entry]) -> "Package":
        """Return the package with entries replaced by those of the same name."""
        by_name = {entry.name: entry for entry in changes}
        return self._replace(entries=[by_name.get(entry.name, entry) for entry in self.entries])


def stored(name: str, kind: bytes, content: bytes) -> Entry:
    return Entry(name, kind, content, len(content))


def compressed(name: str, kind: bytes, content: bytes) -> Entry:
    return Entry(name, kind, zlib.compress(content, 9), len(content), True)


def read(program: bytes) -> Package:
    """Return the package at the end of a program. Raises ImageError if it has none."""
    end = program.rfind(_MAGIC)
    if end < 0:
        raise ImageError("the frozen program carries no PyInstaller package", "PyInstaller's form may have changed")
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
    """Return the octets of a package, which read() can parse; without the program."""
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


def with_modules(archive: bytes, modules: Sequence[OwnModule]) -> bytes:
    """Return an archive of modules with further ones appended. Raises ImageError if it has a module of that name."""
    magic, bytecode, at = _MODULES_HEAD.unpack_from(archive)
    if magic != _MODULES_MAGIC:
        raise ImageError("the frozen program's modules are not in PyInstaller's form", "it may have changed")
    rows = marshal.loads(archive[at:])
    known = {name for name, _ in rows}
    octets = bytearray(archive[:at])
    for module in modules:
        if module.name in known:
            raise ImageError(f"{module.name}: a module of this project was frozen as a third-party module")
        code = zlib.compress(module.code, 9)
        rows.append((module.name, (_PACKAGE if module.is_package else _MODULE, len(octets), len(code))))
        octets += code
    head = _MODULES_HEAD.pack(magic, bytecode, len(octets))
    return bytes(head + octets[len(head) :] + marshal.dumps(rows))


def module_names(archive: bytes) -> list[str]:
    """Return the names in an archive of modules."""
    _, _, at = _MODULES_HEAD.unpack_from(archive)
    return [name for name, _ in marshal.loads(archive[at:])]
