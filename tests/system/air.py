"""Far end of a udp interface: a socket with frames built by hand.

The headers are those of Vanetza's socktap (tests/captures/frames.json). In octets: Ethernet 14, GeoNetworking basic
header 4, common header 8, single hop extension 28, BTP-B 4.
"""

import socket
import struct
from typing import NamedTuple

from tests.system.station import PATIENCE, Table

GEONETWORKING = 0x8947
HEADERS = 14 + 4 + 8 + 28 + 4
NEIGHBOUR = bytes.fromhex("02000000000b")
SINGLE_HOP = 0x50
BEACON = 0x10


class Heard(NamedTuple):
    """Datagram from the station: BTP port and PDU. The port is None if the framing has none."""

    port: int | None
    pdu: bytes


class Air:
    """Peer of a udp interface. `table` is the table of that interface in captain.toml."""

    def __init__(self, framing: str, station_port: int) -> None:
        self.framing = framing
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.settimeout(PATIENCE)
        self.port: int = self.socket.getsockname()[1]
        self.station = ("127.0.0.1", station_port)

    @property
    def table(self) -> Table:
        return {
            "driver": "udp",
            "framing": self.framing,
            "listen": ":".join(map(str, self.station)),
            "peers": [f"127.0.0.1:{self.port}"],
        }

    def throw(self, octets: bytes) -> None:
        """Send a datagram unchanged."""
        self.socket.sendto(octets, self.station)

    def send(self, pdu: bytes, port: int = 2001) -> None:
        """Send a PDU in the framing of this interface."""
        self.throw(framed(self.framing, pdu, port))

    def hear(self) -> Heard:
        """Return the next datagram from the station that carries a PDU."""
        while True:
            octets = self.socket.recv(65536)
            if self.framing == "ethernet" and octets[19] == BEACON:
                continue
            return unframed(self.framing, octets)

    def close(self) -> None:
        self.socket.close()


def framed(framing: str, pdu: bytes, port: int = 2001) -> bytes:
    if framing == "pdu":
        return pdu
    if framing == "btp":
        return struct.pack(">HH", port, 0) + pdu
    return single_hop(pdu, port)


def unframed(framing: str, octets: bytes) -> Heard:
    if framing == "pdu":
        return Heard(None, octets)
    if framing == "btp":
        return Heard(int.from_bytes(octets[:2], "big"), octets[4:])
    assert octets[12:14] == GEONETWORKING.to_bytes(2, "big")
    assert octets[19] == SINGLE_HOP
    assert int.from_bytes(octets[22:24], "big") == len(octets) - HEADERS + 4, "payload length of the common header"
    return Heard(int.from_bytes(octets[54:56], "big"), octets[58:])


def single_hop(pdu: bytes, port: int = 2001, source: bytes = NEIGHBOUR, stamp: int = 0x2D2B4543) -> bytes:
    """Return an Ethernet frame with a GeoNetworking single-hop broadcast, as an ITS-G5 neighbour sends it."""
    ethernet = b"\xff" * 6 + source + GEONETWORKING.to_bytes(2, "big")
    basic = bytes((0x11, 0, 0x1A, 1))  # version 1, common header next; 60 s; one hop
    length = struct.pack(">H", len(pdu) + 4)
    common = bytes((0x20, SINGLE_HOP, 2, 0x80)) + length + bytes((1, 0))  # BTP-B; traffic class 2; mobile
    vector = b"\x80\0" + source + struct.pack(">IiiHH", stamp, 487668616, 114320679, 0x8000, 0)
    return ethernet + basic + common + vector + bytes(4) + struct.pack(">HH", port, 0) + pdu
