"""What is looked at inside a slot: that captain is whole, and that what systemd starts is there."""

import re
from collections.abc import Iterator
from typing import Protocol

from image import archives, bytecode, layers
from image.project import PROJECT

PROGRAM = "usr/lib/captain"
UNITS = "usr/lib/systemd/system"
LICENCES = "usr/share/doc/captain/licences"
# systemd.service(5): what may stand before a program's path.
_STARTED = re.compile(r"^Exec\w+=[-@:+!|]*(/\S+)", re.MULTILINE)


class Slot(Protocol):
    """A file system, read: image/ext4.py. Paths are without a leading slash."""

    def paths(self) -> list[str]: ...
    def read(self, path: str) -> bytes: ...
    def size(self, path: str) -> int: ...
    def target(self, path: str) -> str: ...


def checks(slot: Slot) -> Iterator[tuple[str, str]]:
    """Each check with its trouble, which is empty where it is well."""
    there = set(slot.paths())
    yield "captain has all modules of ours", _modules(slot)
    octets = sum(slot.size(path) for path in there if path.startswith(f"{PROGRAM}/"))
    much = f"{octets / 1e6:.1f} MB and not at most {layers.MOST_MB:g}"
    yield "the size of captain", much if octets > layers.MOST_MB * 1e6 else ""
    licences = [path for path in there if path.startswith(f"{LICENCES}/")]
    yield "licences of what captain carries", "" if licences else f"there is no {LICENCES}"
    yield "programs that units start", ", ".join(_programs(slot, there))
    yield "units that are started", ", ".join(_wanted(slot, there))


def _modules(slot: Slot) -> str:
    package = archives.read(slot.read(f"{PROGRAM}/{layers.NAME}"))
    known = set(archives.module_names(package.entry(archives.MODULES).octets))
    names = [bytecode.name(path.relative_to(PROJECT)) for path in bytecode.sources(PROJECT)]
    missing = [name for name in names if name not in known]
    return f"{missing} are missing" if missing else ""


def _programs(slot: Slot, there: set[str]) -> Iterator[str]:
    """Of our units."""
    for path in sorted(there):
        if re.fullmatch(f"{UNITS}/captain[^/]*", path) and path.endswith((".service", ".socket")):
            for program in _STARTED.findall(slot.read(path).decode()):
                if _merged(program[1:]) not in there:
                    yield f"{path.rsplit('/', 1)[1]}: there is no {program}"


def _wanted(slot: Slot, there: set[str]) -> Iterator[str]:
    """Links of targets that lead nowhere."""
    for path in sorted(there):
        if re.fullmatch(r"etc/systemd/system/[^/]+\.wants/[^/]+", path):
            target = slot.target(path)
            if _merged(target.removeprefix("/")) not in there:
                yield f"{path}: there is no {target}"


def _merged(path: str) -> str:
    """/sbin is /usr/sbin, of which systemd's files know nothing."""
    return f"usr/{path}" if path.split("/", maxsplit=1)[0] in ("bin", "sbin", "lib") else path
