"""Debian package captain-dev: message library and C++ client for compilers."""

import os
import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path

from image.program import deb, frozen
from image.project import PROJECT
from image.step import Steps
from image.tool import run

NAME = "captain-dev"
CLIENT = PROJECT / "firmware/captain_client/cpp"
COPYRIGHT = f"usr/share/doc/{NAME}/copyright"
ALL = ("--all",)  # messages of the library

# Multi-Arch: a cross compiler uses the package of another processor beside this machine's. The client needs the
# recommended headers; the library needs none of them.
_RELATIONS = """\
Multi-Arch: same
Depends: libc6 (>= {c_library})
Recommends: cppzmq-dev, libc6-dev, nlohmann-json3-dev
Suggests: cmake, g++, pkg-config"""
_SYNOPSIS = "ETSI ITS messages and client of a V2X station, for C and C++"
_DESCRIPTION = """\
 Static and shared library captain_messages with C and C++ headers, and the header-only
 C++ client captain_client; both with CMake package and pkg-config file.
"""


def installed(steps: Steps, name: str, triple: str, messages: Sequence[str] = ALL) -> Path:
    """Build and install the library, unless its sources are unchanged; return the folder of the package's files.

    name    name of the step.
    triple  processor by the name that its compiler has: aarch64-linux-gnu.

    Raises ImageError if a tool fails.
    """
    client = [path for path in sorted(CLIENT.rglob("*")) if path.is_file()]
    inputs = [triple, *messages, *frozen.messages_inputs(), *client, Path(__file__)]
    return steps.made(name, inputs, lambda folder: _build(folder, triple, messages)) / "root"


def make(tree: Path, architecture: str, version: str, epoch: int, target: Path) -> None:
    """Make the package; equal files give equal octets.

    tree          result of installed().
    architecture  Debian's name of the processor.
    epoch         date of all files, Unix seconds.

    Raises ImageError if a tool fails.
    """
    with tempfile.TemporaryDirectory() as name:
        root = Path(name) / "package"
        shutil.copytree(tree, root, symlinks=True)
        deb.write(root / COPYRIGHT, (PROJECT / "LICENSE").read_bytes())
        relations = _RELATIONS.format(c_library=deb.c_library(root))
        about = deb.About(NAME, version, architecture, relations, _SYNOPSIS, _DESCRIPTION, "libdevel")
        deb.build(root, about, None, epoch, target)


def _build(folder: Path, triple: str, messages: Sequence[str]) -> None:
    sources = folder / "sources"
    run([frozen.own_python(), "-m", "asn1", "generate", *messages, "--format", "cmake", "--to", sources], PROJECT)
    processor = triple.partition("-")[0]
    compiler = [f"-DCMAKE_C_COMPILER={triple}-gcc", f"-DCMAKE_SYSTEM_PROCESSOR={processor}"]
    cross = [*compiler, "-DCMAKE_SYSTEM_NAME=Linux", f"-DCMAKE_INSTALL_LIBDIR=lib/{triple}"]
    _install(sources, folder / "library", folder / "root", [*cross, f"-DCMAKE_INSTALL_DOCDIR=share/doc/{NAME}"])
    _install(CLIENT, folder / "client", folder / "root", [])  # headers: the same for all processors
    for place in ("sources", "library", "client"):  # 300 MB
        shutil.rmtree(folder / place)


def _install(sources: Path, work: Path, root: Path, options: Sequence[str]) -> None:
    run(["cmake", "-S", sources, "-B", work, "-DCMAKE_INSTALL_PREFIX=/usr", *options])
    run(["cmake", "--build", work, f"-j{os.cpu_count()}"])
    run(["cmake", "--install", work, "--strip"], environment={"DESTDIR": str(root)})
