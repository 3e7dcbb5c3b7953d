"""What the project says of itself, for the card: its version, its date, and what its own code writes for chrony."""

import os
import re
from pathlib import Path

from image.errors import ImageError
from image.program import run

PROJECT = Path(__file__).resolve().parent.parent
# 2106-02-07: times in squashfs, which the update is, and in cpio, which the early boot is, have 32 bits.
LATEST = 0xFFFFFFFF

_CHRONY = "from pps import chrony_configuration as c; print(c.configuration(), c.access('captain'), sep='\\0')"


def epoch() -> int:
    """The date of the build: SOURCE_DATE_EPOCH, or that of the last commit. Unix seconds. Raises ImageError."""
    if given := os.environ.get("SOURCE_DATE_EPOCH", ""):
        return _seconds(given)
    try:
        return int(run(["git", "log", "-1", "--format=%ct"], folder=PROJECT))
    except (ImageError, ValueError) as error:
        raise ImageError("the date of the build is not known: this is no git tree", "set SOURCE_DATE_EPOCH") from error


def _seconds(given: str) -> int:
    if not re.fullmatch("[0-9]{1,10}", given) or int(given) > LATEST:
        what = f"SOURCE_DATE_EPOCH: {given[:40]!r} is not 0 to {LATEST}"
        raise ImageError(what, "give Unix seconds, as date +%s does, or leave it out")
    return int(given)


def version() -> str:
    """Raises ImageError."""
    found = re.search(r'^VERSION = "([^"]+)"', (PROJECT / "firmware/__init__.py").read_text(), re.MULTILINE)
    if not found:
        raise ImageError("firmware/__init__.py: has no VERSION")
    return found[1]


def chrony(python: Path) -> dict[str, str]:
    """chrony's files by their place: the station's own code writes them, and nothing of it is imported here."""
    whole, _, access = run([python, "-c", _CHRONY], folder=PROJECT).partition("\0")
    return {
        "etc/chrony/chrony.conf": whole,
        "etc/systemd/system/chrony.service.d/captain.conf": access.rstrip("\n") + "\n",
    }
