"""Debian packages, and that of captain's directory, for machines other than the box."""

import gzip
import hashlib
import os
import re
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from image import own_files
from image.errors import ImageError
from image.manual import files
from image.tool import run

FILES = Path(__file__).parents[1] / "debian"
UNIT = "usr/lib/systemd/system/captain.service"  # in the overlay and in the package
PLACE = "usr/lib/captain"
DOCUMENTS = "usr/share/doc/captain"
MAINTAINER = "captain <root@localhost>"  # because the package comes from no archive
# Target paths of the files in image/debian; dpkg keeps those in etc if their owner has changed them.
PLACES = {
    "captain.toml": "etc/captain/captain.toml",
    "captain.default": "etc/default/captain",
}

# Scripts of a package that dpkg runs; a package has some of them.
SCRIPTS = ("preinst", "postinst", "prerm", "postrm")

_CONTROL = """\
Package: {about.name}
Version: {about.version}
Architecture: {about.architecture}
Maintainer: {maintainer}
Installed-Size: {size_kib}
{about.relations}
Section: {about.section}
Priority: optional
Description: {about.synopsis}
{about.description}"""

_DESCRIPTION = """\
 The station takes every radio of a box: ITS-G5, 5G, Ethernet, UDP, a serial line.
 It puts all of them behind one ZeroMQ endpoint, that of a vehicleCAPTAIN box.
 .
 This package carries its own interpreter and libraries, except the C library.
"""


class About(NamedTuple):
    """Control fields that differ between packages.

    relations    lines of the fields Depends, Recommends, Suggests and Multi-Arch.
    synopsis     first line of the field Description.
    description  further lines of that field.
    """

    name: str
    version: str
    architecture: str
    relations: str
    synopsis: str
    description: str
    section: str = "net"


def make(
    program: Path, architecture: str, version: str, documents: Mapping[str, bytes], epoch: int, target: Path
) -> None:
    """Make a Debian package; equal files give equal octets.

    program       captain as a directory.
    architecture  Debian's name of the processor.
    documents     documents by path, copyright among them.
    epoch         date of all files, Unix seconds.

    Raises ImageError if a tool fails.
    """
    with tempfile.TemporaryDirectory() as name:
        root = Path(name) / "package"
        _lay_out(program, documents, root)
        _add_manual(files.made(version, epoch), root)
        relations = f"Depends: libc6 (>= {c_library(root / PLACE)}), passwd, procps, zlib1g\nRecommends: chrony"
        about = About("captain", version, architecture, relations, files.SUMMARY, _DESCRIPTION)
        build(root, about, FILES, epoch, target)


def build(root: Path, about: About, scripts: Path | None, epoch: int, target: Path) -> None:
    """Build a Debian package of a folder; equal files give equal octets.

    root     the package's files; those in etc belong to the machine's owner. DEBIAN is added to it.
    about    control fields of the package.
    scripts  folder of those of SCRIPTS that the package has; None: it has none.
    epoch    date of all files, Unix seconds.

    Raises ImageError if a tool fails.
    """
    sizes = [path.stat().st_size for path in root.rglob("*") if path.is_file() and not path.is_symlink()]
    control = _CONTROL.format(about=about, maintainer=MAINTAINER, size_kib=sum(sizes) // 1024)
    _describe(root, control, scripts)
    for path in [root, *root.rglob("*")]:
        if not path.is_symlink():
            path.chmod(0o755 if path.is_dir() or path.stat().st_mode & 0o100 else 0o644)
        os.utime(path, (epoch, epoch), follow_symlinks=False)
    run(
        ["dpkg-deb", "--root-owner-group", "-Zxz", "--build", root, target],
        environment={"SOURCE_DATE_EPOCH": str(epoch)},
    )


def c_library(folder: Path) -> str:
    """Return the oldest C library that satisfies all programs in a folder: 2.36.

    Raises ImageError if the folder has no program.
    """
    found: set[str] = set()
    for path in sorted(folder.rglob("*")):
        if path.is_file() and not path.is_symlink() and path.read_bytes().startswith(b"\x7fELF"):
            found |= set(re.findall(r"Name: GLIBC_([0-9.]+)", run(["readelf", "--version-info", "--wide", path])))
    if not found:
        raise ImageError(f"{folder}: has no program")
    return max(found, key=numbers)


def numbers(version: str) -> tuple[int, ...]:
    """Split a version of the C library or of its symbols, for comparison: "2.36" is (2, 36).

    version  decimal numbers separated by dots. Raises ValueError for others: "2.36-9+deb12u14" has a revision.
    """
    return tuple(map(int, version.split(".")))


def _lay_out(program: Path, documents: Mapping[str, bytes], root: Path) -> None:
    shutil.copytree(program, root / PLACE, symlinks=True)
    (root / "usr/bin").mkdir()
    (root / "usr/bin/captain").symlink_to("../lib/captain/captain")
    for name, place in PLACES.items():
        write(root / place, (FILES / name).read_bytes())
    write(root / UNIT, own_files.read(UNIT, own_files.PACKAGE).encode())
    for name, octets in documents.items():
        write(root / DOCUMENTS / name, octets)


def _add_manual(manual: Mapping[str, str], root: Path) -> None:
    for path, text in manual.items():
        if path.startswith(files.MAN):
            write(root / f"{path}.gz", gzip.compress(text.encode(), mtime=0))  # Debian Policy 12.1: compressed
        else:
            write(root / path, text.encode())


def _describe(root: Path, control: str, scripts: Path | None) -> None:
    paths = sorted(path for path in root.rglob("*") if path.is_file() and not path.is_symlink())
    sums = {path: hashlib.md5(path.read_bytes()).hexdigest() for path in paths}
    names = {path: path.relative_to(root).as_posix() for path in paths}
    conffiles = [name for name in names.values() if name.startswith("etc/")]
    about = root / "DEBIAN"
    write(about / "control", control.encode())
    write(about / "conffiles", "".join(f"/{name}\n" for name in conffiles).encode())
    rows = [f"{digest}  {names[path]}\n" for path, digest in sums.items() if names[path] not in conffiles]
    write(about / "md5sums", "".join(rows).encode())
    for script in (scripts / name for name in SCRIPTS if scripts):
        if script.exists():
            write(about / script.name, script.read_bytes())
            (about / script.name).chmod(0o755)


def write(path: Path, octets: bytes) -> None:
    """Write a file, and make its folders. Raises OSError if that fails."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(octets)
