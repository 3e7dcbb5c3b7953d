"""Verifies a slot: captain complete, units enabled, the rest as described."""

import re
import stat
from collections.abc import Iterator, Mapping
from typing import Protocol

from image.description import Description
from image.parts import root
from image.program.contents import archives, bytecode, layers
from image.project import PROJECT

PROGRAM = "usr/lib/captain"
UNITS = "usr/lib/systemd/system"
LICENCES = "usr/share/doc/captain/licences"
SYSTEM = "etc/systemd/system"
SSHD = "etc/ssh/sshd_config.d"  # the alphabetically first of contradicting files counts
# Debian's programs that run as another user or group: from passwd, util-linux, login, dbus, openssh, pam.
RAISING = frozenset({
    "usr/bin/chage", "usr/bin/chfn", "usr/bin/chsh", "usr/bin/expiry", "usr/bin/gpasswd", "usr/bin/mount",
    "usr/bin/newgrp", "usr/bin/passwd", "usr/bin/ssh-agent", "usr/bin/su", "usr/bin/umount", "usr/sbin/unix_chkpwd",
    "usr/lib/dbus-1.0/dbus-daemon-launch-helper", "usr/lib/openssh/ssh-keysign",
})  # fmt: skip
# systemd.service(5): characters permitted before the path of a program.
_STARTED = re.compile(r"^Exec\w+=[-@:+!|]*(/\S+)", re.MULTILINE)


class Slot(Protocol):
    """File system of a slot, as image/filesystem/ext4.py reads it. Paths have no leading slash."""

    def paths(self) -> list[str]: ...
    def read(self, path: str) -> bytes: ...
    def size(self, path: str) -> int: ...
    def mode(self, path: str) -> int: ...
    def target(self, path: str) -> str: ...


def checks(slot: Slot) -> Iterator[tuple[str, str]]:
    """Yield each check with its trouble, which is empty if it passed."""
    there = set(slot.paths())
    yield "captain has all modules of ours", _modules(slot)
    octets = sum(slot.size(path) for path in there if path.startswith(f"{PROGRAM}/"))
    much = f"{octets / 1e6:.1f} MB and not at most {layers.MOST_MB:g}"
    yield "the size of captain", much if octets > layers.MOST_MB * 1e6 else ""
    licences = [path for path in there if path.startswith(f"{LICENCES}/")]
    yield "licences of what captain carries", "" if licences else f"not found: {LICENCES}"
    yield "programs that units start", ", ".join(_programs(slot, there))
    yield "units that are started", ", ".join(_wanted(slot, there))


def composed(slot: Slot, described: Description, octets: Mapping[str, bytes]) -> Iterator[tuple[str, str]]:
    """Check files that the description determines, and that no others were added; yield as checks().

    octets  contents by path of further files, from other sources.
    """
    there = set(slot.paths())
    laid = {one.path: (one.text.encode(), one.mode) for one in root.overlaid(described)}
    laid |= {path: (content, 0o644) for path, content in octets.items()}
    other = [path for path, (content, mode) in sorted(laid.items())
             if path not in there or slot.read(path) != content or stat.S_IMODE(slot.mode(path)) != mode]  # fmt: skip
    yield "the box's own files", f"{other} are others, or not there" if other else ""
    more = sorted(path for path in there if path.startswith(f"{SSHD}/") and path not in laid)
    yield "configuration of sshd", f"{more} are read, too" if more else ""
    yield "units that are switched on", ", ".join(_switched(slot, there))
    raising = sorted(path for path in there - RAISING if _raises(slot.mode(path)))
    yield "setuid programs", f"by {raising}" if raising else ""
    users = [line.split(":") for line in slot.read("etc/passwd").decode().splitlines()]
    roots = [row[0] for row in users if row[2] == "0"]
    yield "root is the only one", f"{roots} are" if roots != ["root"] else ""


def _raises(mode: int) -> bool:
    return stat.S_ISREG(mode) and bool(mode & (stat.S_ISUID | stat.S_ISGID))


def _switched(slot: Slot, there: set[str]) -> Iterator[str]:
    """Yield units that are not enabled but should be, that are enabled but should not be, and that are not masked."""
    wanted = {f"{SYSTEM}/{target}.wants/{unit}" for target, units in root.WANTED.items() for unit in units}
    found = {path for path in there if re.fullmatch(rf"{SYSTEM}/[^/]+\.(wants|requires)/[^/]+", path)}
    yield from (f"{path} is not" for path in sorted(wanted - found))
    yield from (f"{path} is" for path in sorted(found - wanted))
    for unit in root.MASKED:
        path = f"{SYSTEM}/{unit}"
        if path not in there or slot.target(path) != "/dev/null":
            yield f"{unit} may be"


def _modules(slot: Slot) -> str:
    package = archives.read(slot.read(f"{PROGRAM}/{layers.NAME}"))
    known = set(archives.module_names(package.entry(archives.MODULES).octets))
    names = [bytecode.name(path.relative_to(PROJECT)) for path in bytecode.sources(PROJECT)]
    missing = [name for name in names if name not in known]
    return f"{missing} are missing" if missing else ""


def _programs(slot: Slot, there: set[str]) -> Iterator[str]:
    """Yield missing programs of our units."""
    for path in sorted(there):
        if re.fullmatch(f"{UNITS}/captain[^/]*", path) and path.endswith((".service", ".socket")):
            for program in _STARTED.findall(slot.read(path).decode()):
                if _merged(program[1:]) not in there:
                    yield f"{path.rsplit('/', 1)[1]}: not found: {program}"


def _wanted(slot: Slot, there: set[str]) -> Iterator[str]:
    """Yield links of targets to units that do not exist."""
    for path in sorted(there):
        if re.fullmatch(r"etc/systemd/system/[^/]+\.wants/[^/]+", path):
            target = slot.target(path)
            if _merged(target.removeprefix("/")) not in there:
                yield f"{path}: not found: {target}"


def _merged(path: str) -> str:
    """Return a path in the merged layout: systemd's files may name /sbin for /usr/sbin."""
    return f"usr/{path}" if path.split("/", maxsplit=1)[0] in ("bin", "sbin", "lib") else path
