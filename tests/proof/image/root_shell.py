"""A shell of root in the unchanged image: systemd's own debug shell, for which U-Boot is stopped, as the cable permits.

It is at a second serial port, which only the emulated machine has.
"""

import re
import socket
import time
from pathlib import Path

from tests.proof.image.machine import LIMIT_S, NotSeenError

EXTRA = "systemd.debug_shell=ttyS0"  # of the kernel's command line


class RootShell:
    """words: of QEMU's command line. After Guest.stop_loader(EXTRA)."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / "root"
        self._path.unlink(missing_ok=True)
        self._said = ""
        self._socket = socket.socket(socket.AF_UNIX)
        self._count = 0
        self.words = [
            *("-chardev", f"socket,id=root,path={self._path},server=on,wait=off"),
            *("-device", "pci-serial,chardev=root"),
        ]

    def open(self) -> None:
        """Once the machine runs: until the shell answers. Raises NotSeenError."""
        self._socket.connect(str(self._path))
        ends = time.monotonic() + LIMIT_S
        while time.monotonic() < ends:
            # What came before may have begun a word in quotes.
            self._send(
                b"\x03\nexec env -i PATH=/usr/sbin:/usr/bin PS1= PS2= sh\nstty -echo -onlcr\necho here$((6 * 7))\n"
            )
            if self._has(r"here42\n", 5.0):
                self._said = ""
                return
        raise NotSeenError(f"the debug shell says nothing but {self._said[-500:]!r}")

    def run(self, command: str, limit_s: float = 300.0) -> str:
        """What a command prints, to either output, which is no terminal. Raises NotSeenError when it does not end."""
        self._count += 1
        self._said = ""
        self._send(f"{{ {command}\n}} 2>&1 | cat; echo ended-{self._count}''.\n".encode())
        if not self._has(rf"ended-{self._count}\.\n", limit_s):
            raise NotSeenError(f"{command!r} does not end: {self._said[-500:]!r}")
        return self._said.partition(f"ended-{self._count}.")[0].strip()

    def close(self) -> None:
        self._socket.close()

    def _send(self, octets: bytes) -> None:
        self._socket.settimeout(None)
        self._socket.sendall(octets)

    def _has(self, pattern: str, limit_s: float) -> bool:
        ends = time.monotonic() + limit_s
        while not re.search(pattern, self._said):
            self._socket.settimeout(max(0.01, ends - time.monotonic()))
            try:
                octets = self._socket.recv(65536)
            except TimeoutError:
                return False
            if not octets:
                return False
            self._said += octets.decode("utf-8", "replace").replace("\r", "")
        return True
