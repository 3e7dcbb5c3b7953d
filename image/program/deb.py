"""Debian package of captain's directory, for machines other than the box."""

import hashlib
import os
import re
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path

from image import own_files
from image.errors import ImageError
from image.tool import run

FILES = Path(__file__).parents[1] / "debian"
UNIT = "usr/lib/systemd/system/captain.service"  # in the overlay and in the package
PLACE = "usr/lib/captain"
DOCUMENTS = "usr/share/doc/captain"
MAINTAINER = "captain <root@localhost>"  # because the package comes from no archive
SCRIPTS = ("postinst", "prerm", "postrm")
# Target paths of the files in image/debian; dpkg keeps those in etc if their owner has changed them.
PLACES = {
    "captain.toml": "etc/captain/captain.toml",
    "captain.default": "etc/default/captain",
}

_CONTROL = """\
Package: captain
Version: {version}
Architecture: {architecture}
Maintainer: {maintainer}
Installed-Size: {size_kib}
Depends: libc6 (>= {c_library}), passwd
Recommends: chrony
Section: net
Priority: optional
Description: station software of a V2X box: every radio behind one ZeroMQ endpoint
 The station takes every radio of a box (ITS-G5, 5G, Ethernet, UDP, a serial line)
 and puts all of them behind one ZeroMQ endpoint, that of a vehicleCAPTAIN box.
 .
 This package carries its own interpreter and libraries, except the C library.
"""


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
        sizes = [path.stat().st_size for path in root.rglob("*") if path.is_file() and not path.is_symlink()]
        words = {
            "version": version,
            "architecture": architecture,
            "maintainer": MAINTAINER,
            "size_kib": sum(sizes) // 1024,
            "c_library": c_library(root / PLACE),
        }
        _describe(root, _CONTROL.format(**words))
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
        _write(root / place, (FILES / name).read_bytes())
    _write(root / UNIT, own_files.read(UNIT, own_files.PACKAGE).encode())
    for name, octets in documents.items():
        _write(root / DOCUMENTS / name, octets)


def _describe(root: Path, control: str) -> None:
    paths = sorted(path for path in root.rglob("*") if path.is_file() and not path.is_symlink())
    conffiles = [place for place in PLACES.values() if place.startswith("etc/")]
    sums = {path: hashlib.md5(path.read_bytes()).hexdigest() for path in paths}
    names = {path: path.relative_to(root).as_posix() for path in paths}
    about = root / "DEBIAN"
    _write(about / "control", control.encode())
    _write(about / "conffiles", "".join(f"/{place}\n" for place in sorted(conffiles)).encode())
    rows = [f"{digest}  {names[path]}\n" for path, digest in sums.items() if names[path] not in conffiles]
    _write(about / "md5sums", "".join(rows).encode())
    for name in SCRIPTS:
        _write(about / name, (FILES / name).read_bytes())
        (about / name).chmod(0o755)


def _write(path: Path, octets: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(octets)
