"""What people generate: C sources, the same as a CMake package, the Python module, pages, ASN.1 text."""

import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from asn1 import asn, docs, output, selection, wheel
from asn1.cpython import build, stubs
from asn1.layout import lay_out
from asn1.types import Schema

VERSION = "0.1.0"  # of the library; before 1.0 a minor version may change the structs, so the SONAME holds it
RUNTIME = Path(__file__).parent / "runtime"
PYTHON = Path(__file__).parent / "cpython"
TEMPLATE = Path(__file__).parent / "template"

Progress = Callable[[str], None]
"""Told the name of what is being made."""

FORMS = {
    "cmake": "C library with CMake package, pkg-config file, C++ headers and examples",
    "sources": "plain C sources with C++ headers",
    "python": "Python module captain_messages, built, with typed stubs",
    "wheel": "the same as a wheel for pip, for CPython 3.10 and later",
    "docs": "pages, a Markdown file per message",
    "asn": "ASN.1 text, for other compilers",
    "ros2": "ROS 2 message packages, for colcon and as Debian source packages",
}

WITH_CODE = ("cmake", "sources", "python", "wheel")

NEXT = {
    "cmake": "cmake -S {folder} -B {folder}/build && cmake --build {folder}/build -j && "
    "cmake --install {folder}/build --prefix DIR",
    "sources": "cc -std=c11 -O2 -c -I{folder}/include {folder}/src/*.c",
    "python": "PYTHONPATH={folder} python3 -c 'import captain_messages as m; print(m.all())'",
    "wheel": "pip install {folder}/*.whl",
    "docs": "begin with {folder}/README.md",
    "asn": "one file per module",
    "ros2": "colcon build --base-paths {folder}",
}
"""What to do with a form once it is there."""


class Ros2(NamedTuple):
    """How the messages of the form ros2 are called, and for which ROS 2; and whether code goes to them and back.

    with_cdr  of the forms with code: also from messages to serialised ROS 2 messages and back, in every profile. People
              who have no ROS link none of it.
    """

    profile: str = "etsi_its"
    distro: str = "jazzy"
    with_cdr: bool = False


PROFILES = {
    "etsi_its": "as etsi_its_messages: its nodes, bags and displays take them",
    "v2x_msgs": "as v2x_msgs of vehicleCAPTAIN",
}
DISTROS = ("jazzy", "humble", "kilted")


def generate(
    schema: Schema, messages: tuple[str, ...], form: str, folder: Path, progress: Progress, ros2: Ros2 | None = None
) -> int:
    """Write one form for some messages; form: a key of FORMS. Returns how many files have changed.

    Raises output.NotOursError where the directory belongs to somebody else, build.BuildError, and RosError where ROS 2
    cannot say a message.
    """
    ros2 = ros2 or Ros2()
    if form in ("python", "wheel"):
        return _python(schema, messages, form, folder, progress, ros2.with_cdr)
    if form == "ros2":
        return output.write(folder, lambda made: _ros2(schema, messages, ros2, made, progress), form)
    return output.write(folder, lambda made: _fill(schema, messages, form, made, progress, ros2.with_cdr), form)


def differences(left: Schema, right: Schema, messages: tuple[str, ...]) -> list[str]:
    """Names of the sources that two schemas make differently of some messages."""
    with tempfile.TemporaryDirectory() as folder:
        sides = [Path(folder) / "left", Path(folder) / "right"]
        for side, schema in zip(sides, (left, right), strict=True):
            side.mkdir()
            _sources(schema, messages, side)
        names = {path.relative_to(side) for side in sides for path in side.rglob("*") if path.is_file()}
        return sorted(str(name) for name in names if not _is_same(sides[0] / name, sides[1] / name))


def _is_same(left: Path, right: Path) -> bool:
    return left.is_file() and right.is_file() and left.read_bytes() == right.read_bytes()


def steps(schema: Schema, messages: tuple[str, ...], form: str, with_cdr: bool = False) -> int:
    """How many steps `generate` tells of, at most."""
    match form:
        case "docs" | "ros2":
            return len(messages)
        case "python" | "wheel":
            same = len([*(RUNTIME / "src").glob("*.c"), *PYTHON.glob("*.c")])
            modules = len(lay_out(schema, [schema.messages[name] for name in messages]).nodes)
            # Generating, then each source: the same ones always, code and tables of each module, the lists of messages.
            return 1 + same + 2 * modules + 2 + (_cdr_sources(messages) if with_cdr else 0)
        case _:
            return 1


def _cdr_sources(messages: tuple[str, ...]) -> int:
    """How many C files there are for ROS 2, at most: those of every time, one a package, and their list."""
    same = [*(RUNTIME.parent / "ros2" / "runtime" / "src").glob("*.c"), *(PYTHON / "ros2").glob("*.c")]
    return len(same) + len(PROFILES) * len(messages) + 1


def _fill(
    schema: Schema, messages: tuple[str, ...], form: str, folder: Path, progress: Progress, with_cdr: bool
) -> None:
    """One form into an empty directory."""
    match form:
        case "docs":
            docs.write(schema, messages, folder, progress)
            return
        case "asn":
            progress("ASN.1 text")
            asn.write(selection.part(schema, messages), folder)
            return
        case _:
            progress("C sources")
            _sources(schema, messages, folder)
            if with_cdr:
                _cdr(schema, messages, folder)
    if form == "cmake":
        _package(folder)


def _ros2(schema: Schema, messages: tuple[str, ...], wish: Ros2, folder: Path, progress: Progress) -> None:
    from asn1.ros2 import package, profiles

    packages = profiles.packages(schema, [schema.messages[name] for name in messages], wish.profile)
    for one in packages:
        progress(one.name)
        package.write(schema, one, folder, VERSION, wish.distro)
    package.write_access(schema, packages, folder, VERSION, wish.distro)


def _cdr(schema: Schema, messages: tuple[str, ...], folder: Path) -> None:
    """What goes to ROS 2 and back, beside the sources; a message that a profile cannot say is not in it."""
    from asn1.ros2 import cdr, profiles

    chosen = [schema.messages[name] for name in messages]
    packages = [package for profile in PROFILES for package in profiles.packages(schema, chosen, profile)]
    cdr.write(lay_out(schema, chosen), packages, folder)


def _python(
    schema: Schema, messages: tuple[str, ...], form: str, folder: Path, progress: Progress, with_cdr: bool
) -> int:
    """The module and its stubs; the sources that it is made of lie in .sources, its objects in .objects."""
    chosen = lay_out(schema, [schema.messages[name] for name in messages])
    changed = output.write(folder, lambda made: stubs.write(chosen, made, with_cdr), form)
    sources = folder / ".sources"

    def fill(made: Path) -> None:
        from asn1.ros2 import plan

        _fill(schema, messages, "sources", made, progress, with_cdr)
        editions = [schema.messages[name] for name in messages]
        (made / "src" / "ros2_plan.c").write_text(plan.source(schema, editions), encoding="utf-8")

    changed += output.write(sources, fill, "sources")
    module = build.build_python(sources, folder, is_limited=form == "wheel", progress=progress)
    if form == "wheel":
        wheel.write(folder, VERSION, module, stubs.text(chosen, with_cdr))
    return changed


def _sources(schema: Schema, messages: tuple[str, ...], folder: Path) -> None:
    """include/captain and src: the runtime, and one header, source and C++ header per module."""
    from asn1 import c, cpp  # only here: the list, pages and ASN.1 text come without them

    shutil.copytree(RUNTIME / "include", folder / "include")
    shutil.copytree(RUNTIME / "src", folder / "src")
    c.generate(schema, messages, folder)
    headers = folder / "include" / "captain"
    shutil.copy(TEMPLATE / "messages.hpp", headers)
    cpp.generate(lay_out(schema, [schema.messages[name] for name in messages]), headers)


def _package(folder: Path) -> None:
    """What CMake needs beside the sources."""
    shutil.copy(TEMPLATE / "README.md", folder)
    shutil.copy(TEMPLATE / "CMakeLists.txt", folder)
    shutil.copytree(TEMPLATE / "cmake", folder / "cmake")
    shutil.copytree(TEMPLATE / "example", folder / "example")
    if not (folder / "include" / "captain" / "r1_cam.hpp").exists():
        (folder / "example" / "cam.cpp").unlink()
    sources = sorted(path.relative_to(folder).as_posix() for path in (folder / "src").glob("*.c"))
    lines = [
        f"set(CAPTAIN_MESSAGES_VERSION {VERSION})",
        f"set(CAPTAIN_MESSAGES_SOVERSION {VERSION.rpartition('.')[0]})",
        "set(CAPTAIN_MESSAGES_SOURCES",
        *(f"  {source}" for source in sources),
        ")",
    ]
    (folder / "sources.cmake").write_text("\n".join(lines) + "\n", encoding="utf-8")
