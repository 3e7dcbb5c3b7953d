"""Facts of the project for the card: version, date, chrony's configuration."""

import os
import re
from pathlib import Path

from image.errors import ImageError
from image.tool import run

PROJECT = Path(__file__).resolve().parent.parent
# 2106-02-07: last time in squashfs, the update's format, and cpio, the early boot's; both have 32 bits.
LATEST = 0xFFFFFFFF

_CHRONY = "from pps.chrony import configuration as c; print(c.{}(), c.access('captain', is_optional={}), sep='\\0')"


def epoch() -> int:
    """Return the date of the build: SOURCE_DATE_EPOCH, or that of the last commit. Unix seconds.

    Raises ImageError if SOURCE_DATE_EPOCH is invalid, or absent outside a git tree.
    """
    if given := os.environ.get("SOURCE_DATE_EPOCH", ""):
        return _seconds(given)
    try:
        return int(run(["git", "log", "-1", "--format=%ct"], folder=PROJECT))
    except (ImageError, ValueError) as error:
        raise ImageError("date of the build unknown: not a git tree", "set SOURCE_DATE_EPOCH") from error


def _seconds(given: str) -> int:
    if not re.fullmatch("[0-9]{1,10}", given) or int(given) > LATEST:
        what = f"SOURCE_DATE_EPOCH: {given[:40]!r} is not 0 to {LATEST}"
        raise ImageError(what, "give Unix seconds, as date +%s does, or leave it out")
    return int(given)


def version() -> str:
    """Return VERSION of firmware. Raises ImageError if it is absent."""
    found = re.search(r'^VERSION = "([^"]+)"', (PROJECT / "firmware/__init__.py").read_text(), re.MULTILINE)
    if not found:
        raise ImageError("firmware/__init__.py: has no VERSION")
    return found[1]


def chrony(python: Path) -> dict[str, str]:
    """Return the card's files of chrony by path."""
    whole, access = _chrony(python, "configuration", False)
    return {"etc/chrony/chrony.conf": whole, "etc/systemd/system/chrony.service.d/captain.conf": access}


def chrony_beside(python: Path) -> dict[str, str]:
    """Return drop-ins of a system's own chrony by path: the pulses as a source, and access to its socket."""
    # The owner may remove the source; chronyd starts nevertheless.
    source, access = _chrony(python, "refclock", True)
    return {
        "etc/chrony/conf.d/captain.conf": source,
        "usr/lib/systemd/system/chrony.service.d/captain.conf": access,
    }


def _chrony(python: Path, function: str, is_optional: bool) -> tuple[str, str]:
    """Generate texts by the station's code in a process of its own; it is not imported."""
    text, _, access = run([python, "-c", _CHRONY.format(function, is_optional)], folder=PROJECT).partition("\0")
    return text, access.rstrip("\n") + "\n"
