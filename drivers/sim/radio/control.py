"""Library of a simulated radio: its path, and a client of its control port."""

import socket
import sys
from pathlib import Path

from board.runtime.address import Address
from board.runtime.errors import InterfaceError

NAME = "libsim_v2xcast.so"
VARIABLE = "CAPTAIN_SIM_RADIO"


def library_path() -> Path:
    """Return the path of the library: beside this file in a frozen program, otherwise the output folder of .ci/sim.

    Raises InterfaceError if it does not exist.
    """
    here = Path(__file__)
    folder = here.parent if getattr(sys, "frozen", False) else here.parents[3] / "build" / "sim"
    path = folder / NAME
    if not path.exists():
        raise InterfaceError(f"{path}: the simulated radio is not built", "make setup")
    return path


class Control:
    """Client of the control port of a simulated radio in another process."""

    def __init__(self, address: Address) -> None:
        self.address = address

    def say(self, settings: str) -> None:
        """Send settings such as `loss=0.1 down=1`, without waiting for the answer."""
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC) as sender:
            sender.sendto(settings.encode(), self.address)

    def ask(self, settings: str = "", patience_s: float = 5.0) -> dict[str, int]:
        """Send settings and return the counters, by the names of radio.h.

        Raises InterfaceError if no answer comes, or a setting is invalid.
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
