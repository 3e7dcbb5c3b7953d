"""A frozen program of this machine's processor, as one of another: bytecode stays, what is compiled is exchanged.

The freezer looks at modules, which are the same for every processor, and takes minutes where it is emulated. So it is
run by this machine's build of the image's own Python, and each compiled file that it chose is taken from the other
processor's packages of the same versions.
"""

import re
import shutil
import tempfile
import zipfile
from collections.abc import Iterable, Sequence
from pathlib import Path

from image import archives, layers
from image.errors import ImageError
from image.layers import Tools
from image.program import run

ELF = b"\x7fELF"
LIBRARY = "base_library.zip"  # what the interpreter begins with
C_LIBRARY = "libc6"  # which every system has: of it nothing is carried


def translate(
    made: Path, others: Sequence[Path], libraries: "Libraries", loader: Path, tools: Tools, target: Path
) -> None:
    """A directory for the other processor.

    made    the directory that the freezer made.
    others  folders in which a compiled module lies at the same place as below the program's own folder.
    loader  what starts a frozen program, of the other processor.

    Raises ImageError: something has no twin.
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
    if not any(path.name.startswith("zlib.") for path in compiled):  # part of the interpreter, which can unpack then
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
    """Shared libraries of the other processor. owners: lines "PACKAGE: PATH" of the packages that they are from."""

    def __init__(self, folders: Sequence[Path], owners: str) -> None:
        self._folders = folders
        rows = [line.partition(": ") for line in owners.splitlines()]
        self._everywhere = {path.rsplit("/", 1)[-1] for package, _, path in rows if package == C_LIBRARY}

    def needed(self, files: Iterable[Path]) -> dict[str, Path]:
        """What files need, and what that needs, by name; files that are libraries themselves are among it."""
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
        """Where a library is. Raises ImageError: nowhere."""
        paths = [folder / name for folder in self._folders if (folder / name).exists()]
        if not paths:
            raise ImageError(f"{name}: is in none of the packages", "packages.freeze lacks one")
        return paths[:1]


def pack(library: Path) -> None:
    """The freezer leaves it as large as it is: more than half of it is saved, and read from a slow card."""
    with zipfile.ZipFile(library) as file:
        # The freezer's order is not always the same.
        contents = {name: file.read(name) for name in sorted(file.namelist())}
    with zipfile.ZipFile(library, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as file:
        for name, octets in contents.items():
            file.writestr(zipfile.ZipInfo(name), octets, zipfile.ZIP_DEFLATED)  # of no date


def is_library(place: Path) -> bool:
    """Whether a file of a frozen directory is one that others are linked with. Wheels bring them in NAME.libs."""
    return place.parts[0].endswith(".libs") or (len(place.parts) == 1 and bool(re.match(r"lib.*\.so", place.name)))


def _twin(place: Path, others: Sequence[Path]) -> Path:
    """A compiled module is named by processor, or by none."""
    pattern = re.sub(r"(\.cpython-\d+)-[^.]+\.so$", r"\1-*.so", place.name)
    for folder in others:
        found = sorted((folder / place.parent).glob(pattern))
        if found:
            return found[0]
    raise ImageError(f"{place}: there is no such file for the other processor", "its packages differ from this one's")


def _check(package: archives.Package) -> None:
    """Nothing in it may be of one processor. Raises ImageError."""
    for name in archives.module_names(package.entry(archives.MODULES).octets):
        if name.startswith("_sysconfigdata"):
            raise ImageError(f"{name}: is of one processor", "leave what asks for it out, in firmware/captain.spec")
