"""Benches of modules in a slot: som301e, zed_f9p and sim8202g."""

import socket
from pathlib import Path

from board.runtime.errors import InterfaceError
from drivers.contract import Can, Driver
from drivers.gnss.driver import ZedF9p
from drivers.gnss.options import GnssOptions
from drivers.sim.machine import SimulatedDevice
from drivers.sim.modem.modem import SimulatedModem
from drivers.sim.receiver.receiver import Receiver
from drivers.sim8202g.driver import Sim8202g
from drivers.sim8202g.options import ModemOptions
from tests.drivers.bench import WITH_AREAS, Bench, ModuleBench, OtherStation
from tests.drivers.host import SHARED, Host
from tests.drivers.radio import SimulatedRadio, free_addresses, library
from tests.virtual import VirtualLoop


class Som301eBench(Bench):
    """Bench with the simulated vendor library on a simulated radio, under a file name that can be removed."""

    HANDLERS = 16  # two for each of the usual casters
    can = WITH_AREAS
    has_process = True
    is_brought_up = True
    patience_s = 20.0  # a process has to start

    def __init__(self, loop: VirtualLoop, folder: Path) -> None:
        loop.patience_s = 0.5  # for the process to answer
        self._path = folder / "libeu_v2xcast.so"
        self._library = library()
        self._station = OtherStation()
        *radio, self._address = free_addresses(3)
        self._radio = SimulatedRadio(peers=(self._address,), addresses=radio)
        self._socket: socket.socket | None = None
        self.driver: Driver = self._radio.driver(library=str(self._path))

    def plug(self) -> None:
        self._path.symlink_to(self._library)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(self._address)

    def unplug(self) -> None:
        self._path.unlink()
        self._radio.control.say("crash=1")
        self.close()

    def close(self) -> None:
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def say(self, pdu: bytes) -> None:
        assert self._socket is not None
        try:
            while self._radio.control.ask()["created"] < self.HANDLERS:  # the link is up from the first on
                pass
        except InterfaceError:
            return  # its process is gone
        self._socket.sendto(self._station.encode(pdu), self._radio.listen)

    def heard(self) -> list[bytes]:
        assert self._socket is not None
        found = []
        try:
            while True:
                found.append(self._station.decode(self._socket.recv(4096, socket.MSG_DONTWAIT)))
        except BlockingIOError:
            return found


class ReceiverBench(ModuleBench):
    """Bench with a simulated ZED-F9P behind a stable name."""

    can = Can.POSITION | Can.TIMEMARK

    def __init__(self, loop: VirtualLoop, folder: Path) -> None:
        self._loop = loop
        self._path = folder / "tty"
        self._receiver = Receiver(loop)
        options = GnssOptions(port=str(self._path), receiver_port="usb", rate_hz=1)
        self.driver: Driver = ZedF9p(options, SHARED)

    def plug(self) -> None:
        self._receiver.power(True)
        self._loop.run_until(lambda: bool(self._receiver.path))
        self._path.symlink_to(self._receiver.path)

    def unplug(self) -> None:
        self._path.unlink(missing_ok=True)
        self._receiver.unplug()

    def has_served(self, host: Host) -> bool:
        return any(fix.latitude is not None for fix in host.fixes) and bool(host.time_marks)


class ModemBench(ModuleBench):
    """Bench with a simulated SIM8202G-M2, whose AT port has a stable name. Its service is a bearer."""

    can = Can.BEARER
    patience_s = 0.0

    def __init__(self, loop: VirtualLoop, folder: Path) -> None:
        loop.patience_s = 0.0
        self._loop = loop
        self._path = folder / "tty"
        self._modem = SimulatedModem(loop, self._appeared, lambda: self._path.unlink(missing_ok=True))
        driver = Sim8202g(ModemOptions(port=str(self._path), bearer="none"), SHARED)
        self.driver: Driver = driver

    def plug(self) -> None:
        self._modem.supplied(True)
        self._loop.run_until(lambda: self._modem.is_plugged)

    def unplug(self) -> None:
        self._modem.supplied(False)

    def has_served(self, host: Host) -> bool:
        return host.is_up

    def _appeared(self, device: SimulatedDevice) -> None:
        self._path.symlink_to(next(one.target for one in device.interfaces if one.number == 2))
