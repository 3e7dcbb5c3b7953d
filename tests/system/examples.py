"""Bench of the client's examples: a station with two radios, a receiver and a recorder, and running examples."""

import json
import os
import select
import subprocess
import sys
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import captain_messages as messages

from drivers.wire.gnss.nmea import encode
from firmware.endpoint.control.control_socket import default_paths
from tests.bench import time_receiver
from tests.system.air import Air
from tests.system.conftest import Launcher
from tests.system.station import PATIENCE, ROOT, Station
from tests.system.user import JOIN_MS

FOLDER = ROOT / "firmware/guide/examples"
LATITUDE, LONGITUDE, HEADING = 48.7668, 11.432, 90.0  # degrees: position and heading of the station
G5, V2N = "g5", "v2n"


class ExampleBench:
    """Running station of the examples.

    airs    far ends of its interfaces g5 and v2n.
    folder  of the recorder's ring.
    """

    def __init__(self, launch: Launcher, folder: Path) -> None:
        self.folder = folder
        self.airs: dict[str, Air] = {name: launch.air("pdu") for name in (G5, V2N)}
        self._receiver, port = os.openpty()
        tty.setraw(port)
        launch.at_end(lambda: os.close(port))
        launch.at_end(lambda: os.close(self._receiver))
        self.station: Station = launch.station()
        # A client finds the control socket by the station's first port.
        self.station.control = Path(default_paths(self.station.ports["from_users"])[-1])
        gnss = {"driver": "zed_f9p", "kind": "nmea", "port": os.ttyname(port)}
        recorder = {"folder": str(folder), "in_memory": True, "after_s": 0.1, "keep_on": []}
        self.station.configure({name: air.table for name, air in self.airs.items()} | {"gnss": gnss}, recorder=recorder)
        self.station.start()

    @property
    def address(self) -> str:
        return f":{self.station.ports['from_users']}"

    def drive(self) -> None:
        """Report the position of a car that drives east, from the receiver."""
        now = time.time()
        clock, date = time.strftime("%H%M%S.00", time.gmtime(now)), time.strftime("%d%m%y", time.gmtime(now))
        place = f"{_nmea(LATITUDE, 2)},N,{_nmea(LONGITUDE, 3)},E"
        fix = f"GPGGA,{clock},{place},1,08,1.01,376.2,M,48.0,M,,"
        motion = f"GPRMC,{clock},A,{place},27.0,{HEADING:.2f},{date},,,A"
        os.write(self._receiver, encode(fix) + encode(motion))


class TimedBench:
    """Running station with one interface, whose time comes from a simulated receiver without pulses."""

    def __init__(self, launch: Launcher) -> None:
        command = [sys.executable, "-m", time_receiver.__name__]
        self._receiver = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=ROOT)
        assert self._receiver.stdout is not None
        port = self._receiver.stdout.readline().strip()
        self.air: Air = launch.air("pdu")
        station = launch.station()
        gnss = {"driver": "zed_f9p", "port": port, "baud": 38400}
        station.configure({G5: self.air.table, "gnss": gnss})
        station.start()
        self.address = f":{station.ports['from_users']}"

    def close(self) -> None:
        self._receiver.kill()
        self._receiver.communicate()


def _nmea(degrees: float, digits: int) -> str:
    """Return degrees and minutes as NMEA 0183 writes them; digits: those of the degrees."""
    whole = int(degrees)
    return f"{whole:0{digits}d}{(degrees - whole) * 60:08.5f}"


@contextmanager
def running(name: str | Path, *arguments: object) -> Iterator["subprocess.Popen[str]"]:
    """Run an example until the end of a block. It must not fail on its own."""
    command = [sys.executable, "-u", str(FOLDER / name), *map(str, arguments)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as child:
        try:
            yield child
            assert child.poll() in (None, 0), child.stderr.read() if child.stderr else ""
        finally:
            child.kill()


def lines(child: "subprocess.Popen[str]", again: Callable[[], object]) -> Iterator[str]:
    """Yield the lines that an example prints. again() causes them; it is called until they come."""
    assert child.stdout is not None
    assert child.stderr is not None
    for _ in range(int(PATIENCE * 1000 / JOIN_MS)):
        again()
        while select.select([child.stdout], [], [], JOIN_MS / 1000)[0]:
            if not (line := child.stdout.readline()):
                raise AssertionError(f"the example has ended: {child.stderr.read()}")
            yield line.rstrip("\n")
    raise AssertionError("the example has not printed what it should")


def heard(air: Air, message_id: int) -> dict[str, Any]:
    """Return the next message from the station with this messageID, in the plain dialect."""
    while (octets := air.hear().pdu)[1] != message_id:
        pass
    return plain(octets)


def pdu(kind: str, **fields: object) -> bytes:
    """Return a message with fields by short name or path."""
    message = messages.find(kind)
    octets: bytes = message.encode(message.example(**fields))
    return octets


def plain(octets: bytes) -> dict[str, Any]:
    """Return a message in the plain dialect."""
    for message in messages.all():
        if octets[0] in message.versions and octets[1] in message.ids:
            with suppress(messages.DecodeError):
                found: dict[str, Any] = json.loads(message.to_json(octets, plain=True))
                return found
    raise AssertionError(f"unknown message: {octets.hex()}")
