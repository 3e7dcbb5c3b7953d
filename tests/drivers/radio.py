"""Simulated radios for tests: their ports, the program that runs the library, and drivers on top."""

import random
import socket
import subprocess
import sys
from contextlib import suppress
from functools import cache
from pathlib import Path

from board.runtime.address import Address
from drivers.contract import Shared
from drivers.sim.radio.control import VARIABLE, Control, library_path
from drivers.som301e.driver import Som301e
from drivers.som301e.module import SILENCE_S, RadioProcess
from drivers.som301e.options import Som301eOptions
from drivers.wire import frame
from tests.drivers.bench import OtherStation
from tests.drivers.host import SHARED, Host

ROOT = Path(__file__).parents[2]
PROGRAM = [sys.executable, "-P", str(Path(__file__).with_name("radio_program.py"))]

# Real seconds to wait for the process with the library, which answers much earlier. The virtual clock does not jump
# meanwhile.
PATIENCE_S = 20.0


@cache
def library() -> str:
    """Return the path of the simulated radio's library; build it if it is missing or outdated."""
    subprocess.run([ROOT / ".ci" / "sim"], check=True)
    return str(library_path())


def free_addresses(count: int) -> list[Address]:
    """Return addresses with free ports, outside of the range from which the kernel chooses ports for programs."""
    found: list[Address] = []
    while len(found) < count:
        one = Address("127.0.0.1", random.SystemRandom().randrange(16384, 32768))
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as trial, suppress(OSError):
            trial.bind(one)
            found.append(one)
    return found


class SimulatedRadio:
    """Simulated radio for a driver, with the addresses of its listeners.

    settings  settings of the library in addition to the addresses.
    """

    def __init__(self, settings: str = "", peers: tuple[Address, ...] = (), addresses: list[Address] | None = None):
        self.listen, self.control_port = addresses or free_addresses(2)
        heard_by = f"peers={','.join(map(str, peers))}" if peers else ""
        words = f"listen={self.listen} control={self.control_port} {heard_by} {settings}"
        self.command = ["env", f"{VARIABLE}={words}", *PROGRAM]
        self.control = Control(self.control_port)

    def driver(self, shared: Shared = SHARED, quick: bool = False, beats: bool = False, **options: object) -> Som301e:
        """Return a driver. quick: a blocked call is detected early. beats: a silent process is detected."""
        # Without beats, the driver accepts a long silence, because virtual hours of a test take microseconds.
        silence_s = SILENCE_S if beats else 0.0
        times = {"call_s": 0.4, "check_s": 0.05} if quick else {}
        process = RadioProcess(self.command, silence_s, times)
        return Som301e(Som301eOptions(**{"library": library(), **options}), shared, process)  # type: ignore[arg-type]


class Air:
    """Other station on the air, which builds and parses frames."""

    def __init__(self) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.address = Address(*self.socket.getsockname())
        self.station = OtherStation()

    def say(self, pdu: bytes, to: SimulatedRadio) -> None:
        self.say_frame(self.station.encode(pdu), to)

    def say_frame(self, octets: bytes, to: SimulatedRadio) -> None:
        self.socket.sendto(octets, to.listen)

    def hear(self) -> frame.Ethernet:
        """Return the next frame. Fail after a timeout."""
        self.socket.settimeout(5)
        found = frame.unwrap(self.socket.recv(4096))
        assert isinstance(found, frame.Ethernet)
        return found

    def close(self) -> None:
        self.socket.close()


def is_up(host: Host) -> bool:
    return host.is_up


def all_work(host: Host) -> bool:
    """Return True if the driver has reported all its handlers as working."""
    casters = host.details[-1]["casters"] if host.details else []
    return bool(casters) and all(row.get(way, "up") == "up" for row in casters for way in ("rx", "tx"))  # type: ignore[attr-defined]
