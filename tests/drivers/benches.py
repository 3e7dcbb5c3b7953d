"""Benches: for each driver, the interface under test and its other end.

This file is a list and therefore longer than others. Each bench can be read alone.
"""

import atexit
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
from abc import ABC, abstractmethod
from base64 import b64decode, b64encode
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import ClassVar, Literal, Protocol

from board.netlink import device
from board.runtime.address import address
from board.runtime.errors import InterfaceError
from drivers.contract import Can, Driver
from drivers.ethernet import Ethernet, EthernetOptions
from drivers.gnss.driver import ZedF9p
from drivers.gnss.options import GnssOptions
from drivers.message import Ego, Position
from drivers.morse import Morse, MorseOptions
from drivers.mqtt.driver import Mqtt
from drivers.mqtt.options import MqttOptions
from drivers.sim.machine import SimulatedDevice
from drivers.sim.modem.modem import SimulatedModem
from drivers.sim.receiver.receiver import Receiver
from drivers.sim.serial_line import SerialLine
from drivers.sim8202g.driver import Sim8202g
from drivers.sim8202g.options import ModemOptions
from drivers.uart import Uart, UartOptions
from drivers.udp.driver import Udp, UdpOptions
from drivers.udp.sockets import open_group, open_sender
from drivers.wire import btp, frame, morse
from drivers.wire.geonet.protocol import GeoNetworking, Mib, Received
from drivers.wire.serial_frame import Frame
from firmware.lab.certificates import Pair
from tests.broker.certificates import Authority
from tests.broker.client import Client
from tests.broker.mosquitto import Mosquitto
from tests.drivers.host import SHARED, Host, request
from tests.drivers.radio import SimulatedRadio, free_addresses, library
from tests.system.ports import Ports
from tests.virtual import VirtualLoop

MQTT_PROGRAM = [sys.executable, "-P", str(Path(__file__).parent / "mqtt/program.py")]
GROUP = "239.118.122.97:8947"
WITH_AREAS = Can.RECEIVE | Can.TRANSMIT | Can.GEOBROADCAST
NOWHERE = Ego(722_130_000_000, Position(), is_known=False)


def ip(command: str) -> None:
    subprocess.run(["ip", *command.split()], check=True)


def wait_for_carrier(*names: str) -> None:
    """Wait until new network devices have a carrier, which the kernel reports by netlink a moment later."""
    with socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, 0) as news:
        news.bind((0, 1))
        news.settimeout(2)
        while not all((found := device(name)) and found.is_usable for name in names):
            news.recv(4096)


class OtherStation:
    """GeoNetworking station that builds and parses frames."""

    def __init__(self) -> None:
        self._mac = bytes.fromhex("020000000077")
        self._core = GeoNetworking(self._mac, Mib(beacon_s=0.0))

    def encode(self, pdu: bytes) -> bytes:
        return frame.wrap(self._mac, self._core.encode(request(pdu), 0.0, NOWHERE))

    def decode(self, octets: bytes) -> bytes:
        ethernet = frame.unwrap(octets)
        assert isinstance(ethernet, frame.Ethernet)
        event = self._core.receive(ethernet.packet, ethernet.source, 0.0, NOWHERE.its_ms, lambda: NOWHERE)
        assert isinstance(event, Received)
        return event.pdu


class Bench(Protocol):
    """Interface and its other end, on a loop and with a folder of its own.

    driver         interface under test.
    patience_s     real seconds to wait for events from the kernel.
    can            capabilities that the driver declares.
    has_process    True if the link comes up when a process of the driver reports it.
    is_brought_up  True if the driver reports steps of the bring-up before its link is up.
    """

    driver: Driver
    patience_s: float
    can: ClassVar[Can] = Can.RECEIVE | Can.TRANSMIT
    has_process: ClassVar[bool] = False
    is_brought_up: ClassVar[bool] = False

    def plug(self) -> None:
        """Create the devices or files that the interface needs, and open the other end."""

    def unplug(self) -> None:
        """Remove these devices or files while the interface uses them; plug() may follow."""

    def close(self) -> None:
        """Close the other end."""

    def say(self, pdu: bytes) -> None:
        """Send a PDU to the interface."""

    def heard(self) -> list[bytes]:
        """Return the PDUs that came from the interface since the last call."""


class NetworkBench(Bench, ABC):
    """Bench with a veth pair: v2x0 is the station's device, air0 the other end."""

    patience_s = 2.0

    def __init__(self, loop: VirtualLoop, folder: Path) -> None:
        self.driver: Driver = self.make()
        self._station = OtherStation()
        self._sockets: list[socket.socket] = []

    @abstractmethod
    def make(self) -> Driver:
        """Return the interface under test."""

    @abstractmethod
    def open(self) -> None:
        """Open the sockets of the other end: one to receive, one to send."""

    def plug(self) -> None:
        ip("link add v2x0 type veth peer name air0")
        ip("addr add 10.0.0.1/24 dev v2x0")
        for name in ("v2x0", "air0"):
            Path(f"/proc/sys/net/ipv6/conf/{name}/disable_ipv6").write_text("1")
            ip(f"link set {name} up")
        wait_for_carrier("v2x0", "air0")
        self.open()

    def unplug(self) -> None:
        ip("link del v2x0")
        self.close()

    def close(self) -> None:
        for one in self._sockets:
            one.close()
        self._sockets = []

    def say(self, pdu: bytes) -> None:
        self._sockets[1].send(self.encode(pdu))

    def heard(self) -> list[bytes]:
        found = []
        try:
            while True:
                octets = self._sockets[0].recv(4096)
                if self.is_theirs(octets):
                    found.append(self.decode(octets))
        except BlockingIOError:
            return found

    def is_theirs(self, octets: bytes) -> bool:
        return True

    def encode(self, pdu: bytes) -> bytes:
        return self._station.encode(pdu)

    def decode(self, octets: bytes) -> bytes:
        return self._station.decode(octets)


class UdpBench(NetworkBench):
    framing: ClassVar[Literal["pdu", "btp", "ethernet"]] = "ethernet"
    can = WITH_AREAS

    def make(self) -> Driver:
        return Udp(UdpOptions(framing=self.framing, group=GROUP, device="v2x0", beacon_s=0.0), SHARED)

    def open(self) -> None:
        self._sockets = [open_group(address(GROUP), "v2x0"), open_sender(address(GROUP), "v2x0")]

    def is_theirs(self, octets: bytes) -> bool:
        return octets != self._last

    _last = b""

    def say(self, pdu: bytes) -> None:
        self._last = self.encode(pdu)
        self._sockets[1].send(self._last)


class ListeningBench(UdpBench):
    """UDP bench with reception lanes and a multicast group: the case with most sockets. The group is joined last."""

    def make(self) -> Driver:
        options = UdpOptions(listen="127.0.0.1:0", group=GROUP, device="v2x0", beacon_s=0.0)
        return Udp(options, SHARED)


class BtpBench(UdpBench):
    framing = "btp"
    can = Bench.can

    def encode(self, pdu: bytes) -> bytes:
        return btp.encode(btp.BtpB(request(pdu).btp_port), pdu)

    def decode(self, octets: bytes) -> bytes:
        return btp.decode_b(octets)[1]


class PduBench(UdpBench):
    framing = "pdu"
    can = Bench.can

    def encode(self, pdu: bytes) -> bytes:
        return pdu

    def decode(self, octets: bytes) -> bytes:
        return octets


class EthernetBench(NetworkBench):
    can = WITH_AREAS

    def make(self) -> Driver:
        return Ethernet(EthernetOptions(device="v2x0", beacon_s=0.0), SHARED)

    def open(self) -> None:
        cable = socket.socket(socket.AF_PACKET, socket.SOCK_RAW | socket.SOCK_NONBLOCK, 0)
        cable.bind(("air0", 0x8947))
        self._sockets = [cable, cable]


class UartBench(Bench):
    """Bench with a pty behind a stable name, like those of /dev/serial/by-id."""

    patience_s = 2.0

    def __init__(self, loop: VirtualLoop, folder: Path) -> None:
        self._loop = loop
        self._path = folder / "tty"
        self.driver: Driver = Uart(UartOptions(device=str(self._path)), SHARED)

    def plug(self) -> None:
        self._line = SerialLine(self._loop)
        self._path.symlink_to(self._line.path)

    def unplug(self) -> None:
        self._path.unlink()
        self._line.unplug()

    def close(self) -> None:
        self._line.unplug()

    def say(self, pdu: bytes) -> None:
        self._line.say(request(pdu).btp_port, pdu)

    def heard(self) -> list[bytes]:
        found, self._line.heard = self._line.heard, []
        return [event.pdu for event in found if isinstance(event, Frame)]


class MorseBench(Bench):
    """Bench with two directories, one for each direction."""

    patience_s = 0.0  # no wait: a written file exists at once, and the driver checks by a timer

    def __init__(self, loop: VirtualLoop, folder: Path) -> None:
        self._speak, self._listen = folder / "speak", folder / "listen"
        self._count = 0
        self.driver: Driver = Morse(MorseOptions(speak=str(self._speak), listen=str(self._listen)), SHARED)

    def plug(self) -> None:
        self._speak.mkdir()
        self._listen.mkdir()

    def unplug(self) -> None:
        for folder in (self._speak, self._listen):
            for path in folder.iterdir():
                path.unlink()
            folder.rmdir()

    def close(self) -> None: ...

    def say(self, pdu: bytes) -> None:
        self._count += 1
        part = self._listen / "part"
        part.write_bytes(b"".join(morse.wav(morse.encode(pdu), 20)))
        os.rename(part, self._listen / f"{self._count:09}.wav")

    def heard(self) -> list[bytes]:
        found = []
        for path in sorted(self._speak.glob("*.wav")):
            ear = morse.ToneDecoder()
            ear.receive(path.read_bytes())
            pdu = morse.decode(ear.end())
            assert isinstance(pdu, bytes)
            found.append(pdu)
            path.unlink()
        return found


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


class ModuleBench(ABC):
    """Interface without messages, and the module at its other end.

    can  capabilities of the driver, such as position or bearer.
    """

    driver: Driver
    patience_s = 0.02
    can: ClassVar[Can]
    has_process = False
    is_brought_up = True

    @abstractmethod
    def plug(self) -> None:
        """Plug the module in, and wait until it has booted."""

    @abstractmethod
    def unplug(self) -> None:
        """Unplug the module while the interface uses it; plug() may follow."""

    @abstractmethod
    def has_served(self, host: Host) -> bool:
        """Return True if the driver has provided the module's service to the host, such as a fix."""

    def close(self) -> None:
        """Remove the module."""
        self.unplug()


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


@cache
def _identities() -> tuple[Authority, Pair, Pair, Pair]:
    """Return a certificate authority, and the certificates and keys of broker, station and other end."""
    folder = tempfile.mkdtemp(prefix="captain-bench-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    authority = Authority(Path(folder))
    return authority, authority.server(), authority.client("bench"), authority.client("other")


class MqttBench(Bench):
    """Bench with a real broker with TLS, a second client, and the authority's certificate, which can be removed."""

    patience_s = 20.0  # a process has to start
    can = Bench.can | Can.ANYWHERE
    has_process = True
    is_brought_up = True

    def __init__(self, loop: VirtualLoop, folder: Path) -> None:
        loop.patience_s = 0.5  # for the process to answer
        self._authority, server, own, self._other = _identities()
        ports = Ports()
        self._broker = Mosquitto(folder, ports, self._authority, server=server)
        ports.release()  # not needed: the test has a network namespace of its own
        self._client: Client | None = None
        self._ca = folder / "ca.pem"
        options = MqttOptions(
            url=self._broker.url, client_id="bench", ca=str(self._ca), certificate=str(own.certificate), key=str(own.key)
        )  # fmt: skip
        # The driver must accept a long silence of its process, because virtual hours of a test take microseconds.
        self._mqtt = Mqtt(options, SHARED._replace(types=("cam", "denm")), MQTT_PROGRAM, silence_s=0.0)
        self.driver: Driver = self._mqtt

    def plug(self) -> None:
        self._ca.symlink_to(self._authority.certificate)
        self._broker.start()
        self._client = Client(self._broker.port, "other", authority=self._authority, identity=self._other)
        self._client.subscribe("v2x/btp/+", no_local=True)

    def unplug(self) -> None:
        self._ca.unlink()
        assert self._mqtt._uplink is not None
        worker = self._mqtt._uplink._worker
        assert worker is not None
        assert worker._child is not None
        os.kill(worker._child._process.pid, signal.SIGKILL)
        self.close()

    def close(self) -> None:
        if self._client is not None:
            self._client.close()
            self._client = None
        self._broker.stop()

    def say(self, pdu: bytes) -> None:
        assert self._client is not None
        port = request(pdu).btp_port
        self._client.publish(f"v2x/btp/{port}", b"other(%d): <%s>" % (port, b64encode(pdu)))

    def heard(self) -> list[bytes]:
        assert self._client is not None
        found = []
        while not self._client.messages.empty():
            payload = self._client.messages.get().payload
            found.append(b64decode(payload[payload.index(b"<") + 1 : -1]))
        return found


MODULES: dict[str, Callable[[VirtualLoop, Path], ModuleBench]] = {
    "zed_f9p": ReceiverBench,
    "sim8202g": ModemBench,
}
# Benches by the driver's name. If a driver has several, `-` and a word follow; names of drivers contain no hyphen.
BENCHES: dict[str, Callable[[VirtualLoop, Path], Bench | ModuleBench]] = {
    "udp-pdu": PduBench,
    "udp-btp": BtpBench,
    "udp-ethernet": UdpBench,
    "udp-listen": ListeningBench,
    "ethernet": EthernetBench,
    "uart": UartBench,
    "morse": MorseBench,
    "som301e": Som301eBench,
    "mqtt": MqttBench,
    **MODULES,
}
