"""Output format sources: plain C with C++ headers."""

import shutil
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from asn1.backends.backend import Job, OwnOption, Progress
from asn1.backends.output import FileBackend
from asn1.model.types import Schema

if TYPE_CHECKING:
    from asn1.layout.nodes import Layout

HERE = Path(__file__).parent
RUNTIME = HERE / "runtime"


class Sources(FileBackend):
    """C library in include/captain and src: the runtime, and one header, source and C++ header per module."""

    name = "sources"
    summary = "plain C sources with C++ headers"
    next_step = "cc -std=c11 -O2 -c -I{folder}/include {folder}/src/*.c"
    options: tuple[OwnOption, ...] = ("ros2",)

    def fill(self, job: Job, folder: Path, progress: Progress) -> None:
        progress("C sources")
        layout = _library(job, folder)
        if job.ros2.with_cdr:
            _cdr(job, layout, folder)


def differences(left: Schema, right: Schema, messages: tuple[str, ...]) -> list[str]:
    """Return the names of the generated sources that differ between two schemas."""
    with tempfile.TemporaryDirectory() as folder:
        sides = [Path(folder) / "left", Path(folder) / "right"]
        for side, schema in zip(sides, (left, right), strict=True):
            side.mkdir()
            _library(Job(schema, messages), side)
        names = {path.relative_to(side) for side in sides for path in side.rglob("*") if path.is_file()}
        return sorted(str(name) for name in names if not _is_same(sides[0] / name, sides[1] / name))


def _is_same(left: Path, right: Path) -> bool:
    return left.is_file() and right.is_file() and left.read_bytes() == right.read_bytes()


def _library(job: Job, folder: Path) -> "Layout":
    """Write the library. Returns its layout."""
    from asn1.backends.c import cpp, library
    from asn1.layout.layout import lay_out

    shutil.copytree(RUNTIME / "include", folder / "include")
    shutil.copytree(RUNTIME / "src", folder / "src")
    layout = lay_out(job.schema, job.editions)
    library.write(layout, folder)
    headers = folder / "include" / "captain"
    shutil.copy(HERE / "messages.hpp", headers)
    cpp.generate(layout, headers)
    return layout


def _cdr(job: Job, layout: "Layout", folder: Path) -> None:
    """Write code for serialised ROS 2 messages of every profile."""
    from asn1.backends.ros2 import profiles
    from asn1.backends.ros2.cdr import library
    from asn1.backends.ros2.options import PROFILES

    packages = [package for profile in PROFILES for package in profiles.packages(job.schema, job.editions, profile)]
    library.write(layout, packages, folder)
