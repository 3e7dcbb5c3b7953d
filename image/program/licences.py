"""Documents of a frozen program: its guides, and the licences of its parts."""

import re
import tarfile
from collections.abc import Iterable
from pathlib import Path

from image.program.contents import archives, layers
from image.project import PROJECT

OWN = {"LICENSE": "copyright", "README.md": "README.md", "CHANGELOG.md": "CHANGELOG.md"}
PAGES = ("*/guide/*.md", "*/guide/*.svg", "firmware/reference/*.md")
LOADER = "pyinstaller"  # package whose licence is always included, because its loader starts the program
_IN_A_SLOT = re.compile("usr/share/doc/([^/]+/copyright|captain/licences/.*)")
_NOTICE = re.compile(r"(LICEN[CS]E|COPYING|NOTICE)", re.IGNORECASE)


def documents(program: Path, site: Path, notices: Iterable[Path]) -> dict[str, bytes]:
    """Return the documents by path below /usr/share/doc/captain.

    program  captain as a directory.
    site     folder of the Python packages that it was frozen from.
    notices  copyright files of Debian's packages of interpreter and libraries: usr/share/doc/NAME/copyright.
    """
    found = {target: path.read_bytes() for target, path in own_documents().items()}
    found |= {f"licences/{path.parent.name}": path.read_bytes() for path in notices}
    return found | {f"licences/{name}": octets for name, octets in _of_packages(program, site)}


def own_documents() -> dict[str, Path]:
    """Return the project's own documents: README, guides, reference, licence; by path as in documents()."""
    found = {target: PROJECT / name for name, target in OWN.items()}
    pages = sorted(path for pattern in PAGES for path in PROJECT.glob(pattern))
    return found | {path.relative_to(PROJECT).as_posix(): path for path in pages}


def carried(program: Path) -> set[str]:
    """Return the names of all top-level modules in a program: rich, zmq, firmware."""
    modules = archives.read((program / layers.NAME).read_bytes()).entry(archives.MODULES).octets
    folders = {path.name for path in (program / layers.INSIDE).iterdir() if path.is_dir()}
    return {name.split(".")[0] for name in archives.module_names(modules)} | folders


def of_libraries(program: Path, owners: str) -> list[str]:
    """Return the Debian packages of a program's libraries and interpreter. owners: lines "PACKAGE: PATH"."""
    names = {path.name for path in (program / layers.INSIDE).glob("lib*.so*")}
    rows = [line.partition(": ") for line in owners.splitlines()]
    return sorted({package.split(":")[0] for package, _, path in rows if path.rsplit("/", 1)[-1] in names})


def pack(tree: Path, target: Path) -> None:
    """Pack the licences of everything in a slot into an archive, without dates. tree: the slot's files as a tar."""
    with tarfile.open(tree) as source, tarfile.open(target, "w:xz") as archive:
        for member in source:
            if _IN_A_SLOT.fullmatch(member.name):
                archive.addfile(member, source.extractfile(member) if member.isreg() else None)


def packed(archive: Path) -> set[str]:
    """Return the paths in an archive of pack(). Raises OSError, TarError, LZMAError or EOFError if it is damaged."""
    with tarfile.open(archive, "r:xz") as tar:
        return set(tar.getnames())


def in_slot(paths: Iterable[str]) -> set[str]:
    """Return those of a slot's paths that pack() would include."""
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
        for path in notices or [about / "METADATA"]:  # METADATA names the licence if its text is missing
            yield f"{name}/{path.name}", path.read_bytes()
