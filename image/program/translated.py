"""Translates a frozen program to another processor: keeps bytecode, replaces compiled files.

The freezer takes minutes in emulation, and its choice of modules is the same for every processor. So it runs with this
machine's build of the image's Python. Each compiled file then comes from the other processor's packages of the same
versions.
"""

import re
import shutil
import tempfile
import zipfile
from collections.abc import Iterable, Sequence
from pathlib import Path

from image.errors import ImageError
from image.program.contents import archives, layers
from image.program.contents.layers import Tools
from image.tool import run

ELF = b"\x7fELF"
LIBRARY = "base_library.zip"  # modules that the interpreter needs at its start
C_LIBRARY = "libc6"  # not included, because every system has it


def translate(
    made: Path, others: Sequence[Path], libraries: "Libraries", loader: Path, tools: Tools, target: Path
) -> None:
    """Make the directory for the other processor.

    made    directory that the freezer made.
    others  folders that have compiled modules at the same places as the program's own folder.
    loader  the other processor's executable that starts a frozen program.

    Raises ImageError if a file has no counterpart.
    """
    compiled = []
    for path in sorted((made / layers.INSIDE).rglob("*")):
        place = path.relative_to(made / layers.INSIDE)
        if is_library(place) or path.is_dir():
            continue
        twin = _twin(place, others) if path.read_bytes().startswith(ELF) else path
        copy = target / layers.INSIDE / place.parent / twin.name
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(twin, copy)
        copy.chmod(0o755 if twin != path else 0o644)
        compiled += [copy] if twin != path else []
    if not any(path.name.startswith("zlib.") for path in compiled):  # zlib is built in, so the start can decompress
        pack(target / layers.INSIDE / LIBRARY)
    package = archives.read((made / layers.NAME).read_bytes())
    _check(package)
    for name, path in libraries.needed([*compiled, *libraries.found(package.library.decode())]).items():
        compiled.append(Path(shutil.copyfile(path, target / layers.INSIDE / name)))
    for path in compiled:
        path.chmod(0o755)
        run([tools.strip, path])
    program = Path(shutil.copyfile(loader, target / layers.NAME))
    program.chmod(0o755)
    run([tools.strip, program])
    with tempfile.NamedTemporaryFile() as file:
        file.write(archives.written(package))
        file.flush()
        run([tools.objcopy, "--add-section", f"{archives.SECTION}={file.name}", program])


class Libraries:
    """Shared libraries of the other processor. owners: lines "PACKAGE: PATH" of the packages that contain them."""

    def __init__(self, folders: Sequence[Path], owners: str) -> None:
        self._folders = folders
        rows = [line.partition(": ") for line in owners.splitlines()]
        self._everywhere = {path.rsplit("/", 1)[-1] for package, _, path in rows if package == C_LIBRARY}

    def needed(self, files: Iterable[Path]) -> dict[str, Path]:
        """Return the libraries that files need, directly or indirectly, by name; includes files that are libraries."""
        waiting = list(files)
        found = {path.name: path for path in waiting if is_library(Path(path.name))}
        while waiting:
            said = run(["readelf", "--dynamic", "--wide", waiting.pop()])
            for name in re.findall(r"\(NEEDED\).*\[(.+)\]", said):
                if name not in found and name not in self._everywhere:
                    found[name] = self.found(name)[0]
                    waiting.append(found[name])
        return dict(sorted(found.items()))

    def found(self, name: str) -> list[Path]:
        """Find a library. Raises ImageError if no folder has it."""
        paths = [folder / name for folder in self._folders if (folder / name).exists()]
        if not paths:
            raise ImageError(f"{name}: is in none of the packages", "packages.freeze lacks one")
        return paths[:1]


def pack(library: Path) -> None:
    """Compress an archive that the freezer leaves uncompressed: this saves more than half of a slow card's reading."""
    with zipfile.ZipFile(library) as file:
        # Sorted, because the freezer's order varies.
        contents = {name: file.read(name) for name in sorted(file.namelist())}
    with zipfile.ZipFile(library, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as file:
        for name, octets in contents.items():
            file.writestr(zipfile.ZipInfo(name), octets, zipfile.ZIP_DEFLATED)  # with a fixed date


def is_library(place: Path) -> bool:
    """Return whether a file of a frozen directory is a shared library. Wheels have theirs in NAME.libs."""
    return place.parts[0].endswith(".libs") or (len(place.parts) == 1 and bool(re.match(r"lib.*\.so", place.name)))


def _twin(place: Path, others: Sequence[Path]) -> Path:
    """Return the other processor's file for a compiled module; its name may contain the processor."""
    pattern = re.sub(r"(\.cpython-\d+)-[^.]+\.so$", r"\1-*.so", place.name)
    for folder in others:
        found = sorted((folder / place.parent).glob(pattern))
        if found:
            return found[0]
    raise ImageError(f"{place}: not found for the other processor", "its packages differ from this processor's")


def _check(package: archives.Package) -> None:
    """Check for modules that are specific to a processor. Raises ImageError if there is one."""
    for name in archives.module_names(package.entry(archives.MODULES).octets):
        if name.startswith("_sysconfigdata"):
            raise ImageError(f"{name}: works on one processor only", "exclude its importer in firmware/captain.spec")
