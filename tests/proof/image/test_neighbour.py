"""The scanner that looks at the card from outside, against a guest that is made up here."""

import ipaddress
import struct
from collections import deque
from collections.abc import Callable, Sequence

import pytest

from tests.proof.image import packets
from tests.proof.image.neighbour import Neighbour, answers_echo, tcp_scan, udp_scan
from tests.proof.image.packets import ARP, ICMP, ICMP6, IPV4, IPV6, TCP, UDP
from tests.proof.image.ports import _ports

OPEN, CLOSED = {22, 5555}, {80}


class Guest:
    """Both ends of a wire. Answers as a kernel whose firewall lets OPEN and CLOSED through."""

    def __init__(self) -> None:
        self.name = "eth0"
        self.guest, self.ours = b"\x52\x54\0\0\0\1", b"\x52\x54\0\0\0\2"
        self.answer: Callable[[bytes], Sequence[bytes]] = lambda _: ()
        self._said: deque[bytes] = deque()
        self.resets = 0

    def send(self, octets: bytes) -> None:
        if packets.kind(octets) == ARP:
            asker, asked = (ipaddress.IPv4Address(octets[at : at + 4]) for at in (28, 38))
            said = packets.arp(2, self.guest, asked, octets[6:12], asker)
            self._said.append(packets.frame(octets[6:12], self.guest, ARP, said))
            return
        came = packets.packet(octets)
        assert came is not None
        for protocol, body in self._answers(came):
            said = packets.ip(came.destination, came.source, protocol, body)
            kind = IPV6 if came.source.version == 6 else IPV4
            self._said.append(packets.frame(octets[6:12], self.guest, kind, said))

    def wait(self, is_it: Callable[[bytes], bool], _limit_s: float, what: str) -> bytes:
        while self._said:
            if is_it(octets := self._said.popleft()):
                return octets
        raise AssertionError(what)

    def _answers(self, came: packets.Packet) -> list[tuple[int, bytes]]:
        if came.protocol == ICMP6 and came.body[0] == 135:
            return [(ICMP6, packets.advertisement(self.guest, ipaddress.IPv6Address(came.body[8:24])))]
        if came.protocol in (ICMP, ICMP6):
            return [(came.protocol, bytes((0 if came.protocol == ICMP else 129,)) + came.body[1:])]
        source, port = came.ports
        if came.protocol == TCP:
            said = packets.segment(came.body)
            self.resets += said.flags & packets.RST != 0
            flags = packets.SYN | packets.ACK if port in OPEN else packets.RST | packets.ACK
            is_answered = said.flags == packets.SYN and port in OPEN | CLOSED
            return [(TCP, packets.tcp(port, source, flags, 9, said.number + 1))] if is_answered else []
        if port in CLOSED:
            head = packets.ip(came.source, came.destination, UDP, came.body)[:28]
            return [(ICMP, b"\3\3\0\0\0\0\0\0" + head)]
        return [(UDP, packets.udp(port, source, b"here"))] if port in OPEN else []


@pytest.fixture
def guest() -> Guest:
    return Guest()


@pytest.fixture
def neighbour(guest: Guest) -> Neighbour:
    return Neighbour(guest, "192.0.2.0/24")  # type: ignore[arg-type]


@pytest.mark.parametrize("version", [4, 6])
def test_a_scan_finds_what_is_open_and_what_is_closed(guest: Guest, neighbour: Neighbour, version: int) -> None:
    assert tcp_scan(neighbour, version, range(1, 6000)) == {22: "open", 80: "closed", 5555: "open"}
    assert guest.resets == 2  # no connection is left half open


def test_a_scan_of_datagrams_takes_a_refusal_for_a_hole(neighbour: Neighbour) -> None:
    assert udp_scan(neighbour, 4, lambda _: b"", range(1, 6000)) == {22: "open", 80: "closed", 5555: "open"}


@pytest.mark.parametrize("version", [4, 6])
def test_a_ping_is_answered(neighbour: Neighbour, version: int) -> None:
    assert answers_echo(neighbour, version)


def test_a_checksum_is_that_of_the_example():
    # RFC 1071, clause 3: the sum of 0001 f203 f4f5 f6f7 is ddf2.
    assert packets.checksum(bytes.fromhex("0001f203f4f5f6f7")) == 0xFFFF - 0xDDF2


@pytest.mark.parametrize("version", [4, 6])
def test_a_packet_is_read_as_it_was_made(version: int):
    near, far = ("192.0.2.1", "192.0.2.2") if version == 4 else ("fe80::1", "fe80::2")
    source, to = ipaddress.ip_address(near), ipaddress.ip_address(far)
    octets = packets.ip(source, to, UDP, packets.udp(7, 9, b"odd"))
    came = packets.packet(packets.frame(bytes(6), bytes(6), IPV4 if version == 4 else IPV6, octets))
    assert came is not None
    assert (came.source, came.destination, came.protocol, came.ports) == (source, to, UDP, (7, 9))
    # With its pseudo header a datagram sums up to nothing.
    width = struct.pack("!I3xB", len(came.body), UDP) if version == 6 else struct.pack("!BBH", 0, UDP, len(came.body))
    assert packets.checksum(source.packed + to.packed + width + came.body) == 0


def test_a_client_that_asks_for_a_lease_is_offered_one_and_then_given_it():
    server, given = ipaddress.IPv4Address("192.0.2.2"), ipaddress.IPv4Address("192.0.2.1")
    discover = (
        b"\1\1\6\0" + b"abcd" + bytes(20) + b"\x52\x54\0\0\0\1" + bytes(202) + b"\x63\x82\x53\x63" + b"\x35\1\1\xff"
    )
    offer = packets.lease(discover, server, given)
    assert (offer[:1], offer[4:8], offer[16:20], offer[240:243]) == (b"\2", b"abcd", given.packed, b"\x35\1\2")
    assert packets.lease(discover[:-2] + b"\3\xff", server, given)[240:243] == b"\x35\1\5"
    assert packets.lease(discover[:-2] + b"\7\xff", server, given) == b""  # it gives its lease back


def test_ports_are_told_in_runs():
    assert _ports({5558, 22, 5556, 5555, 5557, 80, 81}) == "22 80 81 5555 to 5558"
    assert _ports(set()) == ""
