"""Where the machine's own files are: a Pi's, or those of a simulated board."""

from pathlib import Path
from typing import NamedTuple


class Machine(NamedTuple):
    """Roots of the files that the kernel offers.

    uevents  path of a Unix socket (SOCK_SEQPACKET) that sends what the kernel would; empty: the kernel, by netlink.
    """

    sys: Path = Path("/sys")
    dev: Path = Path("/dev")
    proc: Path = Path("/proc")
    uevents: str = ""


REAL = Machine()
