"""Simulated radios for tests: their ports, the program that runs the library, and drivers on top."""

import json
import random
import socket
import subprocess
import sys
from contextlib import suppress
from functools import cache
from pathlib import Path

from board.address import Address
from drivers.contract import Shared
from drivers.sim.radio import VARIABLE, Control, library_path
from drivers.som301e import Som301e, Som301eOptions
from drivers.wire import frame
from tests.drivers.host import SHARED, Host

ROOT = Path(__file__).parents[2]
PROGRAM = [sys.executable, "-P", str(Path(__file__).with_name("radio_program.py"))]

# A process with the library answers long before the patience is over: the clock stands unless a test moves it.
PATIENCE_S = 20.0


@cache
def library() -> str:
    """The simulated radio's library, built where it is missing or old."""
    subprocess.run([ROOT / ".ci" / "sim"], check=True)
    return str(library_path())


def free_addresses(count: int) -> list[Address]:
    """Addresses of ports that nobody uses, below those that the kernel gives to others meanwhile."""
    found: list[Address] = []
    while len(found) < count:
        one = Address("127.0.0.1", random.SystemRandom().randrange(16384, 32768))
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as trial, suppress(OSError):
            trial.bind(one)
            found.append(one)
    return found


class SimulatedRadio:
    """A radio that a driver can be started on, and who hears it.

    settings  words for the library beside its addresses.
    """

    def __init__(self, settings: str = "", peers: tuple[Address, ...] = (), addresses: list[Address] | None = None):
        self.listen, self.control_port = addresses or free_addresses(2)
        heard_by = f"peers={','.join(map(str, peers))}" if peers else ""
        words = f"listen={self.listen} control={self.control_port} {heard_by} {settings}"
        self.command = ["env", f"{VARIABLE}={words}", *PROGRAM]
        self.control = Control(self.control_port)

    def driver(self, shared: Shared = SHARED, quick: bool = False, beats: bool = False, **options: object) -> Som301e:
        """quick: a call that does not return is noticed soon; beats: so is a process that says nothing."""
        kind = QuickSom301e if quick else Som301e if beats else UnhurriedSom301e
        return kind(Som301eOptions(**{"library": library(), **options}), shared, self.command)  # type: ignore[arg-type]


class UnhurriedSom301e(Som301e):
    """One whose process may be silent while a test lets hours go by, which are microseconds to the process."""

    silence_s = 0.0


class QuickSom301e(UnhurriedSom301e):
    """One whose library counts as hung after a tenth of a second."""

    def _settings(self) -> bytes:
        return json.dumps({**json.loads(super()._settings()), "call_s": 0.4, "check_s": 0.05}).encode()


class Air:
    """A station on the air that makes and reads frames: what another radio would."""

    def __init__(self) -> None:
        from tests.drivers.benches import OtherStation

        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.address = Address(*self.socket.getsockname())
        self.station = OtherStation()

    def say(self, pdu: bytes, to: SimulatedRadio) -> None:
        self.say_frame(self.station.encode(pdu), to)

    def say_frame(self, octets: bytes, to: SimulatedRadio) -> None:
        self.socket.sendto(octets, to.listen)

    def hear(self) -> frame.Ethernet:
        """The next frame; fails after a while."""
        self.socket.settimeout(5)
        found = frame.unwrap(self.socket.recv(4096))
        assert isinstance(found, frame.Ethernet)
        return found

    def close(self) -> None:
        self.socket.close()


def is_up(host: Host) -> bool:
    return host.is_up


def all_work(host: Host) -> bool:
    """Whether every handler has said that it works."""
    casters = host.details[-1]["casters"] if host.details else []
    return bool(casters) and all(row.get(way, "up") == "up" for row in casters for way in ("rx", "tx"))  # type: ignore[attr-defined]
