"""Roots of the kernel's files: a Pi's, or a simulated board's."""

from pathlib import Path
from typing import NamedTuple


class Machine(NamedTuple):
    """Roots of the files that the kernel provides.

    uevents  path of a Unix socket (SOCK_SEQPACKET) that sends the kernel's uevents. Empty: netlink.
    """

    sys: Path = Path("/sys")
    dev: Path = Path("/dev")
    proc: Path = Path("/proc")
    uevents: str = ""


REAL = Machine()
