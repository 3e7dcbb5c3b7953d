"""Benches of drivers with a network device: udp and ethernet."""

import socket
from abc import ABC, abstractmethod
from pathlib import Path
from typing import ClassVar, Literal

from board.runtime.address import address
from drivers.contract import Driver
from drivers.ethernet import Ethernet, EthernetOptions
from drivers.udp.driver import Udp, UdpOptions
from drivers.udp.sockets import open_group, open_sender
from drivers.wire import btp
from tests.drivers.bench import WITH_AREAS, Bench, OtherStation
from tests.drivers.host import SHARED, request
from tests.drivers.veth import ip, wait_for_carrier
from tests.virtual import VirtualLoop

GROUP = "239.118.122.97:8947"


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
