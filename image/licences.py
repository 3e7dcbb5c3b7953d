"""What is to be read about captain, and the licences of all that its frozen program carries."""

import re
import tarfile
from collections.abc import Iterable
from pathlib import Path

from image import archives, layers
from image.project import PROJECT

OWN = {"LICENSE": "copyright", "README.md": "README.md", "CHANGELOG.md": "CHANGELOG.md"}
LOADER = "pyinstaller"  # what starts the program is of it, whatever is imported
_IN_A_SLOT = re.compile("usr/share/doc/([^/]+/copyright|captain/licences/.*)")
_NOTICE = re.compile(r"(LICEN[CS]E|COPYING|NOTICE)", re.IGNORECASE)


def documents(program: Path, site: Path, notices: Iterable[Path]) -> dict[str, bytes]:
    """Files by their place below /usr/share/doc/captain.

    program  captain as a directory.
    site     the packages that it was frozen from.
    notices  copyright files of Debian's packages, usr/share/doc/NAME/copyright: interpreter and libraries.
    """
    found = {target: (PROJECT / name).read_bytes() for name, target in OWN.items()}
    found |= {f"licences/{path.parent.name}": path.read_bytes() for path in notices}
    return found | {f"licences/{name}": octets for name, octets in _of_packages(program, site)}


def carried(program: Path) -> set[str]:
    """Names of all that can be imported: rich, zmq, firmware."""
    modules = archives.read((program / layers.NAME).read_bytes()).entry(archives.MODULES).octets
    folders = {path.name for path in (program / layers.INSIDE).iterdir() if path.is_dir()}
    return {name.split(".")[0] for name in archives.module_names(modules)} | folders


def of_libraries(program: Path, owners: str) -> list[str]:
    """Debian's packages that its libraries and interpreter are from. owners: lines "PACKAGE: PATH"."""
    names = {path.name for path in (program / layers.INSIDE).glob("lib*.so*")}
    rows = [line.partition(": ") for line in owners.splitlines()]
    return sorted({package.split(":")[0] for package, _, path in rows if path.rsplit("/", 1)[-1] in names})


def pack(tree: Path, target: Path) -> None:
    """An archive of the licences of everything in a slot, without dates. tree: its files as a tar."""
    with tarfile.open(tree) as source, tarfile.open(target, "w:xz") as archive:
        for member in source:
            if _IN_A_SLOT.fullmatch(member.name):
                archive.addfile(member, source.extractfile(member) if member.isreg() else None)


def packed(archive: Path) -> set[str]:
    """Paths in such an archive. Raises OSError, TarError, LZMAError and EOFError."""
    with tarfile.open(archive, "r:xz") as tar:
        return set(tar.getnames())


def in_slot(paths: Iterable[str]) -> set[str]:
    """Those of a slot's paths that such an archive has."""
    return {path for path in paths if _IN_A_SLOT.fullmatch(path)}


def _of_packages(program: Path, site: Path) -> Iterable[tuple[str, bytes]]:
    names = carried(program)
    for about in sorted(site.glob("*.dist-info")):
        name = about.name.removesuffix(".dist-info")
        rows = [row.split(",")[0].split("/")[0] for row in (about / "RECORD").read_text().splitlines()]
        if not name.startswith(f"{LOADER}-") and not names & {row.removesuffix(".py") for row in rows}:
            continue
        files = [path for path in sorted(about.rglob("*")) if path.is_file()]
        notices = [path for path in files if _NOTICE.match(path.name) or path.parent.name == "licenses"]
        for path in notices or [about / "METADATA"]:  # which names the licence where its text is left out
            yield f"{name}/{path.name}", path.read_bytes()
