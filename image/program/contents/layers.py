"""Joins captain from two layers: PyInstaller's frozen third-party modules, and ours.

The result is the same as PyInstaller's from both at once: one archive of modules, the program's script, files beside
it. A change of our sources does not need a new freeze, which takes minutes in emulation.
"""

import shutil
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

from image.program.contents import archives, bytecode
from image.program.contents.archives import Package
from image.tool import run

NAME = "captain"
# Limits in MB for both processors, without numpy.
MOST_MB, MOST_MB_OF_FILE = 36.0, 16.0
INSIDE = "_internal"  # folder beside the program
_BINARY, _DATA, _LINK = b"b", b"x", b"n"


class Tools(NamedTuple):
    """Names of binutils for the program's processor."""

    objcopy: str = "objcopy"
    strip: str = "strip"


def files(root: Path, parts: Mapping[str, Path]) -> dict[str, Path]:
    """Return the files beside our modules by their place: data files and compiled parts."""
    data = [path for pattern in bytecode.DATA for path in sorted(root.glob(pattern))]
    return {path.relative_to(root).as_posix(): path for path in data} | dict(parts)


def directory(foreign: Path, ours: bytecode.Compiled, beside: Mapping[str, Path], tools: Tools, target: Path) -> None:
    """Make captain as a directory.

    foreign  directory that PyInstaller made from the third-party modules.
    beside   result of files() for our modules.

    Raises ImageError if a tool fails.
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
    """Return the size of captain as a directory: the sum of its files, without rounding to blocks; links as such."""
    return sum(path.lstat().st_size for path in folder.rglob("*") if path.is_file())


def one_file(folder: Path, tools: Tools, target: Path) -> None:
    """Make captain as one file, which unpacks the others at each start. folder: result of directory()."""
    shutil.copyfile(folder / NAME, target)
    target.chmod(0o755)
    package = archives.read(target.read_bytes())
    modules = package.entry(archives.MODULES)  # PyInstaller's order has it last
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
