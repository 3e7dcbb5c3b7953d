"""Both forms of captain that are handed out, read as files: size, compiled parts, C library."""

import zlib
from pathlib import Path

from image.program import deb
from image.program.contents import archives, layers
from image.tool import run
from tests.proof.image.rows import Row

FLOOR = "2.36"  # GLIBC of Debian 12, which Raspberry Pi OS Bookworm is made of
ELF = b"\x7fELF"


def unpack_package(package: Path, folder: Path) -> Path:
    """The directory of the program in a Debian package."""
    run(["dpkg-deb", "--extract", package, folder])
    return folder / deb.PLACE


def unpack_file(program: Path, folder: Path) -> Path:
    """Compiled parts of the one file, in a folder: its start and what it unpacks when it runs."""
    folder.mkdir(parents=True)
    octets = program.read_bytes()
    (folder / layers.NAME).write_bytes(octets)
    for number, entry in enumerate(archives.read(octets).entries):
        content = zlib.decompress(entry.octets) if entry.is_compressed else entry.octets
        if content.startswith(ELF):
            (folder / f"{number}-{Path(entry.name).name}").write_bytes(content)
    return folder


def compiled(folder: Path) -> list[Path]:
    """ELF files below it."""
    files = sorted(path for path in folder.rglob("*") if path.is_file() and not path.is_symlink())
    return [path for path in files if path.read_bytes().startswith(ELF)]


def size_row(what: str, octets: int, most_mb: float) -> Row:
    return Row(what, f"{octets / 1e6:.1f} MB", f"at most {most_mb:g} MB", octets <= most_mb * 1e6)


def floor_row(what: str, folder: Path) -> Row:
    """The newest symbol version of the C library that a compiled part asks for."""
    found = deb.c_library(folder)
    seen = f"GLIBC_{found}, {len(compiled(folder))} ELF files"
    return Row(what, seen, f"at most GLIBC_{FLOOR}", deb.numbers(found) <= deb.numbers(FLOOR))


def rows(package: Path, program: Path, folder: Path) -> list[Row]:
    """Figures of a processor's two forms."""
    directory, parts = unpack_package(package, folder / "package"), unpack_file(program, folder / "parts")
    return [
        size_row("directory", layers.octets(directory), layers.MOST_MB),
        size_row("one file", program.stat().st_size, layers.MOST_MB_OF_FILE),
        Row("Debian package", f"{package.stat().st_size / 1e6:.1f} MB", "", True),
        floor_row("directory: C library", directory),
        floor_row("one file: C library", parts),
        _same_parts(directory, parts),
    ]


def _same_parts(directory: Path, parts: Path) -> Row:
    """The one file was read whole: a part that was overlooked would have no floor."""
    counts = len(compiled(directory)), len(compiled(parts))
    return Row("ELF files of both forms", f"{counts[0]}, {counts[1]}", "the same number", counts[0] == counts[1] > 0)
