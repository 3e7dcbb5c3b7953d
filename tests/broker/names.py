"""A name server that never answers, and a program that has to ask it: resolv.conf is another one in its mount namespace.

Port 53 needs root, or a network namespace of one's own (tests/drivers: @pytest.mark.namespace).
"""

import itertools
import os
import select
import socket
from collections.abc import Sequence
from pathlib import Path
from typing import Self

# Of loopback's own, so that a name server of the machine is not in the way.
_addresses = itertools.count(1)
SCRIPT = 'mount --bind "$1" /etc/resolv.conf && mount --bind "$2" /etc/nsswitch.conf && shift 2 && exec "$@"'


class SilentNames:
    """Takes questions and leaves them unanswered: the C library asks twice, 5 s each. `folder` is its own."""

    def __init__(self, folder: Path) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.address = f"127.53.{os.getpid() & 0xFF}.{next(_addresses) & 0xFF}"
        self.socket.bind((self.address, 53))
        self._resolv, self._switch = folder / "resolv.conf", folder / "nsswitch.conf"
        self._resolv.write_text(f"nameserver {self.address}\n")
        self._switch.write_text("hosts: files dns\n")

    def asked_by(self, command: Sequence[str]) -> list[str]:
        """The command, with this name server. Its process is the program's own: exec all the way."""
        private = ["unshare", "--mount", "--propagation", "private"]
        if os.geteuid() != 0:
            private.append("--map-root-user")
        return [*private, "sh", "-c", SCRIPT, "sh", str(self._resolv), str(self._switch), *command]

    def question(self, patience: float = 5.0) -> bytes:
        """The next question, as it came."""
        self.socket.settimeout(patience)
        return self.socket.recv(512)

    def is_asked(self) -> bool:
        """Whether a question has come since the last one that was taken."""
        return bool(select.select([self.socket], [], [], 0)[0])

    def close(self) -> None:
        self.socket.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
