"""The archives of a frozen program: what goes in comes out, and what is not changed keeps its octets."""

import marshal
import struct
import zlib

import pytest

from image.errors import ImageError
from image.program.contents import archives
from image.program.contents.archives import Package, compressed, stored
from image.program.contents.bytecode import OwnModule

ENTRIES = [
    compressed("struct", b"m", b"module" * 20),
    stored("__main__", b"s", b"first script"),
    compressed("lib/libx.so.1", b"b", b"\x7fELF" * 50),
    stored("libx.so", b"n", b"lib/libx.so.1\0"),
    stored("PYZ.pyz", b"z", b"modules"),
    stored("X utf8", b"o", b""),
]
PACKAGE = Package(ENTRIES, 313, b"libpython3.13.so.1.0")


def modules(*names: str) -> bytes:
    """As PyInstaller writes them: a head of 17 octets, each module by itself, rows of (name, (kind, place, size))."""
    octets, rows = bytearray(17), []
    for name in names:
        code = zlib.compress(marshal.dumps(compile("", f"{name}.py", "exec")), 6)
        rows.append((name, (0, len(octets), len(code))))
        octets += code
    octets[:12] = b"PYZ\0" + b"magi" + struct.pack("!i", len(octets))
    return bytes(octets) + marshal.dumps(rows)


def test_a_package_is_read_as_it_was_written_wherever_in_a_program_it_is():
    assert archives.read(b"\x7fELF program" + archives.written(PACKAGE) + b"section headers") == PACKAGE


def test_rows_of_a_package_are_aligned_as_the_program_reads_them():
    octets = archives.written(PACKAGE)
    _, size, at, rows, python, library = struct.unpack("!8sIIII64s", octets[-88:])
    assert (size, at + rows + 88, python, library.rstrip(b"\0")) == (len(octets), len(octets), 313, PACKAGE.library)
    while rows:
        (length,) = struct.unpack_from("!I", octets, at)
        assert length % 16 == 0
        at, rows = at + length, rows - length


def test_an_entry_is_replaced_in_its_place():
    changed = PACKAGE.replaced([stored("__main__", b"s", b"other")])
    assert [entry.name for entry in changed.entries] == [entry.name for entry in ENTRIES]
    assert changed.entry("__main__").octets == b"other"
    assert changed.entry("struct") == PACKAGE.entry("struct")


def test_modules_are_added_behind_those_that_stay_as_they_are():
    before = modules("rich", "zmq")
    code = marshal.dumps(compile("x = 1", "board/__init__.py", "exec"))
    after = archives.with_modules(before, [OwnModule("board", True, code)])
    assert archives.module_names(after) == ["rich", "zmq", "board"]
    (at,) = struct.unpack_from("!I", before, 8)
    assert after[17:at] == before[17:at]
    assert after[:8] == before[:8]
    (rows_at,) = struct.unpack_from("!I", after, 8)
    kind, place, size = marshal.loads(after[rows_at:])[-1][1]
    assert (kind, zlib.decompress(after[place : place + size])) == (1, code)


def test_a_module_of_ours_that_was_frozen_with_what_is_not_ours_is_told():
    with pytest.raises(ImageError, match="board: a module of this project was frozen as a third-party module"):
        archives.with_modules(modules("board"), [OwnModule("board", True, b"")])


@pytest.mark.parametrize("octets", [b"", b"\x7fELF and no package"])
def test_a_program_without_a_package_is_told(octets: bytes):
    with pytest.raises(ImageError, match="carries no PyInstaller package"):
        archives.read(octets)


def test_modules_in_another_form_are_told():
    with pytest.raises(ImageError, match="not in PyInstaller's form"):
        archives.with_modules(b"ZYP\0" + bytes(13), [])
