"""One bench per driver: the interface under test and what is at the other end of it."""

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

from board.address import address
from board.errors import InterfaceError
from board.netlink import device
from drivers.contract import Can, Driver
from drivers.ethernet import Ethernet, EthernetOptions
from drivers.gnss_options import GnssOptions
from drivers.message import Ego, Position
from drivers.modem_options import ModemOptions
from drivers.morse import Morse, MorseOptions
from drivers.mqtt import Mqtt
from drivers.mqtt_options import MqttOptions
from drivers.sim.machine import SimulatedDevice
from drivers.sim.modem import SimulatedModem
from drivers.sim.receiver import Receiver
from drivers.sim.serial_line import SerialLine
from drivers.sim8202g import Sim8202g
from drivers.uart import Uart, UartOptions
from drivers.udp import Udp, UdpOptions
from drivers.udp_socket import open_group, open_sender
from drivers.wire import btp, frame, morse
from drivers.wire.geonet import GeoNetworking, Received
from drivers.wire.serial_frame import Frame
from drivers.zed_f9p import ZedF9p
from firmware.lab.certificates import Pair
from tests.broker.certificates import Authority
from tests.broker.client import Client
from tests.broker.mosquitto import Mosquitto
from tests.drivers.host import SHARED, Host, request
from tests.drivers.radio import SimulatedRadio, free_addresses, library
from tests.system.ports import Ports
from tests.virtual import VirtualLoop

MQTT_PROGRAM = [sys.executable, "-P", str(Path(__file__).with_name("mqtt_program.py"))]
GROUP = "239.118.122.97:8947"
NOWHERE = Ego(722_130_000_000, Position(), is_known=False)


def ip(command: str) -> None:
    subprocess.run(["ip", *command.split()], check=True)


def wait_for_carrier(*names: str) -> None:
    """Until devices that were set up run: the kernel tells a moment later, by netlink."""
    with socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, 0) as news:
        news.bind((0, 1))
        news.settimeout(2)
        while not all((found := device(name)) and found.is_usable for name in names):
            news.recv(4096)


class OtherStation:
    """A GeoNetworking station that makes and reads frames."""

    def __init__(self) -> None:
        self._mac = bytes.fromhex("020000000077")
        self._core = GeoNetworking(self._mac, beacon_s=0.0)

    def encode(self, pdu: bytes) -> bytes:
        return frame.wrap(self._mac, self._core.encode(request(pdu), 0.0, NOWHERE))

    def decode(self, octets: bytes) -> bytes:
        ethernet = frame.unwrap(octets)
        assert isinstance(ethernet, frame.Ethernet)
        event = self._core.receive(ethernet.packet, ethernet.source, 0.0, NOWHERE)
        assert isinstance(event, Received)
        return event.pdu


class Bench(Protocol):
    """An interface and its other end, made on a loop with a folder of its own.

    driver      the interface under test.
    patience_s  real time for the kernel to tell.
    """

    driver: Driver
    patience_s: float

    def plug(self) -> None:
        """Make what the interface needs, and open the other end."""

    def unplug(self) -> None:
        """Take it away while the interface uses it; plug() may follow."""

    def close(self) -> None:
        """Close the other end."""

    def say(self, pdu: bytes) -> None:
        """Send a PDU to the interface."""

    def heard(self) -> list[bytes]:
        """The PDUs that came from the interface since the last call."""


class NetworkBench(ABC):
    """A veth pair: v2x0 is the station's, air0 the other end."""

    patience_s = 2.0

    def __init__(self, loop: VirtualLoop, folder: Path) -> None:
        self.driver: Driver = self.make()
        self._station = OtherStation()
        self._sockets: list[socket.socket] = []

    @abstractmethod
    def make(self) -> Driver:
        """The interface."""

    @abstractmethod
    def open(self) -> None:
        """Open the sockets of the other end: that which hears, that which says."""

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
    """Lanes of its own beside the group: most sockets of all, and the group is joined last."""

    def make(self) -> Driver:
        options = UdpOptions(listen="127.0.0.1:0", group=GROUP, device="v2x0", beacon_s=0.0)
        return Udp(options, SHARED)


class BtpBench(UdpBench):
    framing = "btp"

    def encode(self, pdu: bytes) -> bytes:
        return btp.encode(btp.BtpB(request(pdu).btp_port), pdu)

    def decode(self, octets: bytes) -> bytes:
        return btp.decode_b(octets)[1]


class PduBench(UdpBench):
    framing = "pdu"

    def encode(self, pdu: bytes) -> bytes:
        return pdu

    def decode(self, octets: bytes) -> bytes:
        return octets


class EthernetBench(NetworkBench):
    def make(self) -> Driver:
        return Ethernet(EthernetOptions(device="v2x0", beacon_s=0.0), SHARED)

    def open(self) -> None:
        cable = socket.socket(socket.AF_PACKET, socket.SOCK_RAW | socket.SOCK_NONBLOCK, 0)
        cable.bind(("air0", 0x8947))
        self._sockets = [cable, cable]


class UartBench:
    """A pty behind a name that stays the same, as one of /dev/serial/by-id."""

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


class MorseBench:
    """Two directories: one for each direction."""

    patience_s = 0.0  # a file is there when it is written, and the driver looks by a timer

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
            ear = morse.Ear()
            ear.receive(path.read_bytes())
            pdu = morse.decode(ear.end())
            assert isinstance(pdu, bytes)
            found.append(pdu)
            path.unlink()
        return found


class Som301eBench:
    """The simulated library on a simulated radio, under a name that can be taken away."""

    HANDLERS = 16  # two for each of the usual casters
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
    """An interface that carries no messages, and the module at its other end.

    can  what it is able to do in place of that.
    """

    driver: Driver
    patience_s = 0.02
    can: ClassVar[Can]

    @abstractmethod
    def plug(self) -> None:
        """Put the module in, and wait until it has booted."""

    @abstractmethod
    def unplug(self) -> None:
        """Pull it out while the interface uses it; plug() may follow."""

    @abstractmethod
    def has_served(self, host: Host) -> bool:
        """Whether the host was given what the module is there for."""

    def close(self) -> None:
        """Take the module away."""
        self.unplug()


class ReceiverBench(ModuleBench):
    """A simulated ZED-F9P behind a name that stays the same."""

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
    """A simulated SIM8202G-M2 whose AT port has a name that stays the same; a bearer is what it is there for."""

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
    """An authority; what the broker, the station and the other end show."""
    folder = tempfile.mkdtemp(prefix="captain-bench-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    authority = Authority(Path(folder))
    return authority, authority.server(), authority.client("bench"), authority.client("other")


class MqttBench:
    """A real broker with TLS, another client at it, and a certificate of the authority that can be taken away."""

    patience_s = 20.0  # a process has to start

    def __init__(self, loop: VirtualLoop, folder: Path) -> None:
        loop.patience_s = 0.5  # for the process to answer
        self._authority, server, own, self._other = _identities()
        ports = Ports()
        self._broker = Mosquitto(folder, ports, self._authority, server=server)
        ports.release()  # the network namespace is this test's alone
        self._client: Client | None = None
        self._ca = folder / "ca.pem"
        options = MqttOptions(
            url=self._broker.url, client_id="bench", ca=str(self._ca), certificate=str(own.certificate), key=str(own.key)
        )  # fmt: skip
        self._mqtt = UnhurriedMqtt(options, SHARED._replace(types=("cam", "denm")), MQTT_PROGRAM)
        self.driver: Driver = self._mqtt

    def plug(self) -> None:
        self._ca.symlink_to(self._authority.certificate)
        self._broker.start()
        self._client = Client(self._broker.port, "other", authority=self._authority, identity=self._other)
        self._client.subscribe("v2x/btp/+", no_local=True)

    def unplug(self) -> None:
        self._ca.unlink()
        worker = self._mqtt._worker
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


class UnhurriedMqtt(Mqtt):
    """One whose process may be silent while a test lets hours go by, which are microseconds to the process."""

    silence_s = 0.0


MODULES: dict[str, Callable[[VirtualLoop, Path], ModuleBench]] = {
    "zed_f9p": ReceiverBench,
    "sim8202g": ModemBench,
}
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
