"""Machine on the guest's cable: DHCP server, neighbour, port scanner.

The guest's kernel takes frames of one device one after the other. Once it has answered a question of the link (ARP,
or a neighbour solicitation), it has handled all earlier frames.
"""

import ipaddress
import struct
from collections.abc import Callable, Iterable, Iterator, Mapping

from tests.proof.image import packets
from tests.proof.image.packets import ARP, ICMP, ICMP6, IPV4, IPV6, TCP, UDP, Address, Packet
from tests.proof.image.wire import Wire

LIMIT_S = 600.0  # emulated, on a busy machine
BATCH = 512  # probes, then a question of the link: what may lie in queues until then
SOURCE = 40000
DHCP_SERVER, DHCP_CLIENT = 67, 68


class Neighbour:
    """Holds the other end of a wire. network: the first address is the guest's, the second its own.

    gives_lease  to whoever asks.
    is_leased    whether the guest has taken the lease.
    heard        what the guest has sent by itself: (protocol, destination, port).
    """

    def __init__(self, wire: Wire, network: str) -> None:
        self.wire = wire
        self.guest, self.own = list(ipaddress.IPv4Network(network).hosts())[:2]
        self.guest6, self.own6 = packets.link_local(wire.guest), packets.link_local(wire.ours)
        self.gives_lease = True
        self.is_leased = False
        self.heard: set[tuple[int, str, int]] = set()
        wire.answer = self._answers

    def probe(self, body: bytes, protocol: int, to: Address, source: Address | None = None, mac: bytes = b"") -> None:
        """A packet to an address of the guest, of its network device, or of whatever lies behind it."""
        source = source or (self.own if to.version == 4 else self.own6)
        kind = IPV4 if to.version == 4 else IPV6
        octets = packets.ip(source, to, protocol, body)
        self.wire.send(packets.frame(mac or self.wire.guest, self.wire.ours, kind, octets))

    def knock(self, version: int, bodies: Iterable[tuple[int, bytes]], to: Address | None = None) -> Iterator[Packet]:
        """Sends probes of (protocol, body), and gives what the guest answers, until it has answered all of them."""
        to = to or (self.guest if version == 4 else self.guest6)
        self.settle(version)
        for count, (protocol, body) in enumerate(bodies, 1):
            self.probe(body, protocol, to)
            if count % BATCH == 0:
                yield from self.settle(version)
        yield from self.settle(version)

    def settle(self, version: int = 4) -> list[Packet]:
        """All packets that came until the guest has answered a question of the link. Raises NotSeenError."""
        found: list[Packet] = []

        def is_answer(octets: bytes) -> bool:
            if version == 4 and packets.kind(octets) == ARP:
                return octets[20:22] == b"\0\2" and octets[28:32] == self.guest.packed
            came = packets.packet(octets)
            if came is None:
                return False
            if version == 6 and came.protocol == ICMP6 and came.body[:1] == b"\x88":
                return came.body[8:24] == self.guest6.packed
            found.append(came)
            return False

        self.wire.send(self._question(version))
        self.wire.wait(is_answer, LIMIT_S, "an answer of the link")
        return found

    def _question(self, version: int) -> bytes:
        mac = self.wire.ours
        if version == 4:
            return packets.frame(self.wire.guest, mac, ARP, packets.arp(1, mac, self.own, bytes(6), self.guest))
        body = packets.ip(self.own6, self.guest6, ICMP6, packets.solicitation(mac, self.guest6))
        return packets.frame(self.wire.guest, mac, IPV6, body)

    def _answers(self, octets: bytes) -> list[bytes]:
        """What a machine says by itself: who it is, a lease, and that it takes a connection to port 80."""
        mac, to = self.wire.ours, octets[6:12]
        if packets.kind(octets) == ARP and octets[20:22] == b"\0\1" and octets[38:42] == self.own.packed:
            asker = ipaddress.IPv4Address(octets[28:32])
            return [packets.frame(to, mac, ARP, packets.arp(2, mac, self.own, to, asker))]
        came = packets.packet(octets)
        if came is None:
            return []
        self._note(came)
        if came.protocol == ICMP6 and came.body[:1] == b"\x87" and came.body[8:24] == self.own6.packed:
            body = packets.ip(self.own6, came.source, ICMP6, packets.advertisement(mac, self.own6))
            return [packets.frame(to, mac, IPV6, body)]
        if came.protocol == UDP and came.ports == (DHCP_CLIENT, DHCP_SERVER):
            return self._leased(came)
        if came.protocol == TCP and came.destination == self.own and came.ports[1] == 80:
            return self._taken(came, to)
        return []

    def _note(self, came: Packet) -> None:
        if came.protocol == UDP:
            self.heard.add((UDP, str(came.destination), came.ports[1]))

    def _leased(self, came: Packet) -> list[bytes]:
        answer = packets.lease(came.body[8:], self.own, self.guest) if self.gives_lease else b""
        if not answer:
            return []
        self.is_leased = self.is_leased or answer[242] == 5
        body = packets.ip(self.own, self.guest, UDP, packets.udp(DHCP_SERVER, DHCP_CLIENT, answer))
        return [packets.frame(came.source_mac, self.wire.ours, IPV4, body)]

    def _taken(self, came: Packet, to: bytes) -> list[bytes]:
        said = packets.segment(came.body)
        if not said.flags & packets.SYN:
            return []
        reply = packets.tcp(80, said.source, packets.SYN | packets.ACK, 7, said.number + 1 & 0xFFFFFFFF)
        return [packets.frame(to, self.wire.ours, IPV4, packets.ip(self.own, came.source, TCP, reply))]


def tcp_scan(neighbour: Neighbour, version: int, ports: Iterable[int], to: Address | None = None) -> Mapping[int, str]:
    """Each port that says anything: "open" (it takes a connection) or "closed" (it says that nobody is there)."""
    found: dict[int, str] = {}
    probes = ((TCP, packets.tcp(SOURCE, port, packets.SYN, port)) for port in ports)
    for came in neighbour.knock(version, probes, to):
        if came.protocol == TCP and came.ports[1] == SOURCE:
            said = packets.segment(came.body)
            is_open = said.flags & packets.SYN and said.flags & packets.ACK
            found[said.source] = "open" if is_open else "closed"
            if is_open:  # else it would be said again and again
                reset = packets.tcp(SOURCE, said.source, packets.RST, said.acknowledged)
                neighbour.probe(reset, TCP, came.source)
        elif refused := _refused(came):
            found[refused] = "closed"
    return found


def udp_scan(
    neighbour: Neighbour, version: int, content: Callable[[int], bytes], ports: Iterable[int], source: int = SOURCE
) -> Mapping[int, str]:
    """Each port that says anything: "open" (a datagram came back) or "closed". content: of the datagram to a port."""
    found: dict[int, str] = {}
    probes = ((UDP, packets.udp(source, port, content(port))) for port in ports)
    for came in neighbour.knock(version, probes):
        if came.protocol == UDP and came.ports[1] == source:
            found[came.ports[0]] = "open"
        elif refused := _refused(came):
            found[refused] = "closed"
    return found


def _refused(came: Packet) -> int:
    """The port that an ICMP message says to be unreachable; 0: it is none, or of something else."""
    is_refusal = (came.protocol == ICMP and came.body[:1] == b"\3") or (
        came.protocol == ICMP6 and came.body[:1] == b"\1"
    )
    if not is_refusal:
        return 0
    head = 8 + (20 if came.protocol == ICMP else 40)
    return int(struct.unpack("!H", came.body[head + 2 : head + 4])[0])


def answers_echo(neighbour: Neighbour, version: int) -> bool:
    protocol, reply = (ICMP, b"\0") if version == 4 else (ICMP6, b"\x81")
    came = neighbour.knock(version, [(protocol, packets.echo_request(version))])
    return any(one.protocol == protocol and one.body[:1] == reply for one in list(came))
