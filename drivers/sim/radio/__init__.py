"""A simulated SOM301-E: a shared library with the calls of the vendor's, whose air is UDP datagrams.

Each datagram is a whole Ethernet frame with GeoNetworking, as of the `udp` interface with framing ethernet: that
interface, another simulated radio, or Vanetza's tools can be at the other end. How it behaves is read from the
environment variable CAPTAIN_SIM_RADIO and can be changed while it runs; settings.h has the words.
"""

import socket
import sys
from pathlib import Path

from board.address import Address
from board.errors import InterfaceError

NAME = "libsim_v2xcast.so"
VARIABLE = "CAPTAIN_SIM_RADIO"


def library_path() -> Path:
    """Where the library is: beside this file in a frozen program, else where .ci/sim builds it.

    Raises InterfaceError when it is in neither.
    """
    here = Path(__file__)
    folder = here.parent if getattr(sys, "frozen", False) else here.parents[3] / "build" / "sim"
    path = folder / NAME
    if not path.exists():
        raise InterfaceError(f"{path}: the simulated radio is not built", "make setup")
    return path


class Control:
    """The control port of a simulated radio that runs in another process."""

    def __init__(self, address: Address) -> None:
        self.address = address

    def say(self, settings: str) -> None:
        """Change settings, words as `loss=0.1 down=1`; does not wait for the answer."""
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC) as sender:
            sender.sendto(settings.encode(), self.address)

    def ask(self, settings: str = "", patience_s: float = 5.0) -> dict[str, int]:
        """Change settings and wait for the counters, by the names of radio.h.

        Raises InterfaceError when no answer comes, or when a word was not understood.
        """
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC) as sender:
            sender.settimeout(patience_s)
            try:
                sender.connect(self.address)
                sender.send(settings.encode())
                answer = sender.recv(2048).decode()
            except OSError as error:
                raise InterfaceError(f"the simulated radio does not answer: {error}") from error
        if answer.startswith("not understood"):
            raise InterfaceError(f"the simulated radio: {answer}")
        return {key: int(value) for key, _, value in (word.partition("=") for word in answer.split())}
