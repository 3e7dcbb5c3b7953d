"""Ethernet, ARP, IPv4, IPv6, TCP, UDP, ICMP and DHCP, as much of them as looking at a box from outside takes.

Source: RFC 826 (ARP), 791, 8200, 9293 (TCP), 768, 792, 4443, 4861 (neighbours), 2131 and 2132 (DHCP).
"""

import ipaddress
import struct
from typing import NamedTuple

ARP, IPV4, IPV6 = 0x0806, 0x0800, 0x86DD
ICMP, TCP, UDP, ICMP6 = 1, 6, 17, 58
SYN, RST, ACK = 2, 4, 16
BROADCAST = b"\xff" * 6
Address = ipaddress.IPv4Address | ipaddress.IPv6Address


class Packet(NamedTuple):
    """An IP packet of a frame. protocol: of TCP, UDP, ICMP, ICMPv6; body: with its header."""

    source_mac: bytes
    source: Address
    destination: Address
    protocol: int
    body: bytes

    @property
    def ports(self) -> tuple[int, int]:
        """Source and destination, of TCP and UDP."""
        return struct.unpack("!HH", self.body[:4])


class Segment(NamedTuple):
    """Of TCP."""

    source: int
    destination: int
    number: int
    acknowledged: int
    flags: int


def checksum(octets: bytes) -> int:
    """RFC 1071."""
    padded = octets + b"\0" * (len(octets) % 2)
    total: int = sum(struct.unpack(f"!{len(padded) // 2}H", padded))
    while total >> 16:
        total = (total & 0xFFFF) + (total >> 16)
    return ~total & 0xFFFF


def frame(to: bytes, source: bytes, kind: int, body: bytes) -> bytes:
    return to + source + struct.pack("!H", kind) + body


def kind(octets: bytes) -> int:
    """The EtherType."""
    return int.from_bytes(octets[12:14], "big")


def packet(octets: bytes) -> Packet | None:
    """None: it is no whole IP packet without options."""
    body = octets[14:]
    if kind(octets) == IPV4 and len(body) >= 20:
        length, protocol = struct.unpack("!2xH5xB", body[:10])
        head = 4 * (body[0] & 15)
        source, destination = (ipaddress.IPv4Address(body[at : at + 4]) for at in (12, 16))
        return Packet(octets[6:12], source, destination, protocol, body[head:length])
    if kind(octets) == IPV6 and len(body) >= 40:
        length, protocol = struct.unpack("!4xHB", body[:7])
        far, near = (ipaddress.IPv6Address(body[at : at + 16]) for at in (8, 24))
        return Packet(octets[6:12], far, near, protocol, body[40 : 40 + length])
    return None


def segment(body: bytes) -> Segment:
    source, destination, number, acknowledged, flags = struct.unpack("!HHIIxB", body[:14])
    return Segment(source, destination, number, acknowledged, flags)


def ip(source: Address, destination: Address, protocol: int, body: bytes) -> bytes:
    """A packet; the checksum of ICMPv6, TCP and UDP, which is 0 in body, is filled in."""
    at = {TCP: 16, UDP: 6, ICMP6: 2}.get(protocol)
    if at is not None:
        width = "!I3xB" if source.version == 6 else "!BBH"
        length = (len(body), protocol) if source.version == 6 else (0, protocol, len(body))
        found = checksum(source.packed + destination.packed + struct.pack(width, *length) + body)
        body = body[:at] + struct.pack("!H", found or 0xFFFF) + body[at + 2 :]
    if source.version == 6:
        head = struct.pack("!IHBB", 6 << 28, len(body), protocol, 255)
        return head + source.packed + destination.packed + body
    head = struct.pack("!BBHHHBBH", 0x45, 0, 20 + len(body), 0, 0x4000, 64, protocol, 0)
    head += source.packed + destination.packed
    return head[:10] + struct.pack("!H", checksum(head)) + head[12:] + body


def tcp(source: int, destination: int, flags: int, number: int = 0, acknowledged: int = 0) -> bytes:
    """A segment without content."""
    return struct.pack("!HHIIBBHHH", source, destination, number, acknowledged, 5 << 4, flags, 65535, 0, 0)


def udp(source: int, destination: int, content: bytes = b"") -> bytes:
    return struct.pack("!HHHH", source, destination, 8 + len(content), 0) + content


def echo_request(version: int) -> bytes:
    body = struct.pack("!BBHHH", 128 if version == 6 else 8, 0, 0, 1, 1)
    return body if version == 6 else body[:2] + struct.pack("!H", checksum(body)) + body[4:]


def arp(operation: int, source_mac: bytes, source: Address, to_mac: bytes, to: Address) -> bytes:
    """operation  1: a request, 2: a reply."""
    return struct.pack("!HHBBH", 1, IPV4, 6, 4, operation) + source_mac + source.packed + to_mac + to.packed


def solicitation(source_mac: bytes, target: Address) -> bytes:
    return struct.pack("!BBHI", 135, 0, 0, 0) + target.packed + b"\1\1" + source_mac


def advertisement(source_mac: bytes, target: Address) -> bytes:
    return struct.pack("!BBHI", 136, 0, 0, 0x60000000) + target.packed + b"\2\1" + source_mac


def router_advertisement(prefix: ipaddress.IPv6Network) -> bytes:
    """Of a router that offers addresses and a way out, RFC 4861, 4.2 and 4.6.2."""
    option = struct.pack("!BBBBIII", 3, 4, prefix.prefixlen, 0xC0, 3600, 3600, 0) + prefix.network_address.packed
    return struct.pack("!BBHBBHII", 134, 0, 0, 64, 0, 1800, 0, 0) + option


def link_local(mac: bytes) -> ipaddress.IPv6Address:
    """RFC 4291, appendix A."""
    number = bytes((mac[0] ^ 2,)) + mac[1:3] + b"\xff\xfe" + mac[3:]
    return ipaddress.IPv6Address(b"\xfe\x80" + bytes(6) + number)


def lease(request: bytes, server: Address, given: Address) -> bytes:
    """The answer of a DHCP server to what a client has sent (the content of its datagram); empty: none is due."""
    options = _options(request[240:])
    answers = {1: 2, 3: 5}  # discover: offer; request: acknowledge
    if request[:1] != b"\1" or options.get(53, b"\0")[0] not in answers:
        return b""
    head = (
        struct.pack("!BBBB", 2, 1, 6, 0) + request[4:8] + struct.pack("!HH", 0, int.from_bytes(request[10:12], "big"))
    )
    head += bytes(4) + given.packed + server.packed + bytes(4) + request[28:44] + bytes(192) + b"\x63\x82\x53\x63"
    told = {53: bytes((answers[options[53][0]],)), 54: server.packed, 51: struct.pack("!I", 3600), 1: b"\xff\xff\xff\0"}
    told |= {3: server.packed, 6: server.packed}
    return head + b"".join(bytes((code, len(value))) + value for code, value in told.items()) + b"\xff"


def _options(octets: bytes) -> dict[int, bytes]:
    found = {}
    while octets and octets[0] != 255:
        if octets[0] == 0:
            octets = octets[1:]
            continue
        found[octets[0]] = octets[2 : 2 + octets[1]]
        octets = octets[2 + octets[1] :]
    return found
