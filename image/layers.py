"""captain from two layers: what is not ours, frozen once by PyInstaller, and ours, compiled within seconds.

The outcome is what PyInstaller would have made of both at once: one archive of modules, the program's script, files
beside it. A change of our sources does not freeze an interpreter again, which takes minutes in emulation.
"""

import shutil
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

from image import archives, bytecode
from image.archives import Package
from image.program import run

NAME = "captain"
# Limits of either processor, without numpy.
MOST_MB, MOST_MB_OF_FILE = 36.0, 16.0
INSIDE = "_internal"  # the folder beside the program
_BINARY, _DATA, _LINK = b"b", b"x", b"n"


class Tools(NamedTuple):
    """Of binutils, for the processor that the program is for."""

    objcopy: str = "objcopy"
    strip: str = "strip"


def files(root: Path, parts: Mapping[str, Path]) -> dict[str, Path]:
    """What lies beside our modules, by its place: their data, and parts that are compiled."""
    data = [path for pattern in bytecode.DATA for path in sorted(root.glob(pattern))]
    return {path.relative_to(root).as_posix(): path for path in data} | dict(parts)


def directory(foreign: Path, ours: bytecode.Compiled, beside: Mapping[str, Path], tools: Tools, target: Path) -> None:
    """captain as a directory.

    foreign  the directory that PyInstaller has made of what is not ours.
    beside   files() of ours.

    Raises ImageError.
    """
    shutil.copytree(foreign, target, symlinks=True)
    for place, path in beside.items():
        copy = target / INSIDE / place
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(path, copy)
        copy.chmod(0o755 if path.suffix == ".so" else 0o644)
        if path.suffix == ".so":
            run([tools.strip, copy])
    program = target / NAME
    package = archives.read(program.read_bytes())
    modules = archives.with_modules(package.entry(archives.MODULES).octets, ours.modules)
    changed = package.replaced(
        [
            archives.stored(archives.MODULES, package.entry(archives.MODULES).kind, modules),
            archives.stored(archives.SCRIPT, package.entry(archives.SCRIPT).kind, ours.script),
        ]
    )
    _carry(program, changed, tools)


def octets(folder: Path) -> int:
    """Size of captain as a directory: its files without the room that a file system adds; links by their own size."""
    return sum(path.lstat().st_size for path in folder.rglob("*") if path.is_file())


def one_file(folder: Path, tools: Tools, target: Path) -> None:
    """The same as one file, which unpacks the rest at each start. folder: as directory() makes it."""
    shutil.copyfile(folder / NAME, target)
    target.chmod(0o755)
    package = archives.read(target.read_bytes())
    modules = package.entry(archives.MODULES)  # which PyInstaller puts last
    others = [entry for entry in package.entries if entry != modules]
    _carry(target, package._replace(entries=[*others, *_packed(folder / INSIDE), modules]), tools)


def _packed(folder: Path) -> Iterable[archives.Entry]:
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if path.is_symlink():
            yield archives.stored(name, _LINK, str(path.readlink()).encode() + b"\0")
        elif path.is_file():
            yield archives.compressed(name, _BINARY if ".so" in path.name else _DATA, path.read_bytes())


def _carry(program: Path, package: Package, tools: Tools) -> None:
    with tempfile.NamedTemporaryFile() as file:
        file.write(archives.written(package))
        file.flush()
        run([tools.objcopy, "--update-section", f"{archives.SECTION}={file.name}", program])
