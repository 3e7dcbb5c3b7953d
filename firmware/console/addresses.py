"""Addresses of this machine, and the reachability of its ports."""

import ipaddress
import socket
import struct
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

# linux/netlink.h, linux/rtnetlink.h, linux/if_addr.h
HEADER = struct.Struct("=IHHII")  # struct nlmsghdr: length, type, flags, sequence, port
ADDRESS = struct.Struct("=BBBBI")  # struct ifaddrmsg: family, prefix length, flags, scope, device's index
ATTRIBUTE = struct.Struct("=HH")  # struct rtattr: length, type
RTM_NEWADDR, RTM_GETADDR = 20, 22
NLMSG_DONE, NLMSG_ERROR = 3, 2
NLM_F_REQUEST, NLM_F_DUMP = 0x1, 0x300
IFA_ADDRESS, IFA_LOCAL = 1, 2
BEYOND_LINK = 253  # scopes of less reach beyond the link; link is 253, host is 254

LISTEN = "0A"  # state of a listening socket in /proc/net/tcp
SYSTEM = Path("/")


class AddressedDevice(NamedTuple):
    """Network device: state as in RFC 2863; addresses with prefix length, those of the widest scope first."""

    name: str
    state: str
    addresses: tuple[str, ...]


def devices(root: Path = SYSTEM) -> list[AddressedDevice]:
    """Return all devices except the loopback, those without address last; unreadable devices are omitted."""
    found = addresses(_dump())
    listed = []
    with suppress(OSError):
        for path in sorted((root / "sys/class/net").iterdir()):
            with suppress(OSError, ValueError):  # the device disappears meanwhile
                number = int((path / "ifindex").read_text())
                state = (path / "operstate").read_text().strip()
                listed.append(AddressedDevice(path.name, state, tuple(found.get(number, ()))))
    return sorted((one for one in listed if one.name != "lo"), key=lambda one: not one.addresses)


def addresses(dump: bytes) -> dict[int, list[str]]:
    """Return the addresses by device index from an answer to RTM_GETADDR; a truncated rest is ignored."""
    rows = sorted(_rows(dump), key=lambda row: row[:2])
    found: dict[int, list[str]] = {}
    for _, _, number, text in rows:
        found.setdefault(number, []).append(text)
    return found


def is_open(port: int, root: Path = SYSTEM) -> bool:
    """Return whether a program listens on the port on an address other than the loopback."""
    for table in ("tcp", "tcp6"):
        with suppress(OSError):
            for line in (root / "proc/net" / table).read_text().splitlines()[1:]:
                address, _, number = line.split()[1].partition(":")
                if line.split()[3] == LISTEN and int(number, 16) == port and not _is_loopback(address):
                    return True
    return False


def _is_loopback(address: str) -> bool:
    """Return whether an address is a loopback's; it is written as hexadecimal words in the machine's byte order."""
    words = (int(address[at : at + 8], 16).to_bytes(4, sys.byteorder) for at in range(0, len(address), 8))
    found = ipaddress.ip_address(b"".join(words))
    mapped = getattr(found, "ipv4_mapped", None)
    return (mapped or found).is_loopback


def _dump() -> bytes:
    """Return all addresses as netlink messages; the kernel answers within the calls."""
    said = bytearray()
    question = HEADER.pack(HEADER.size + ADDRESS.size, RTM_GETADDR, NLM_F_REQUEST | NLM_F_DUMP, 1, 0)
    with suppress(OSError), socket.socket(socket.AF_NETLINK, socket.SOCK_RAW | socket.SOCK_NONBLOCK, 0) as asker:
        asker.send(question + ADDRESS.pack(0, 0, 0, 0, 0))
        while len(said) < 1 << 20:
            part = asker.recv(1 << 16)
            said += part
            if HEADER.unpack_from(part)[1] in (NLMSG_DONE, NLMSG_ERROR):
                break
    return bytes(said)


def _rows(dump: bytes) -> Iterator[tuple[bool, int, int, str]]:
    """Yield sort keys (scope, then IPv4 first), device index and text of each address."""
    at = 0
    while at + HEADER.size + ADDRESS.size <= len(dump):
        length, kind, _, _, _ = HEADER.unpack_from(dump, at)
        if length < HEADER.size:
            return
        if kind == RTM_NEWADDR:
            family, prefix, _, scope, number = ADDRESS.unpack_from(dump, at + HEADER.size)
            values = dict(_attributes(dump[at + HEADER.size + ADDRESS.size : at + length]))
            # On a point-to-point device, IFA_ADDRESS is the peer's address.
            octets = values.get(IFA_LOCAL, values.get(IFA_ADDRESS, b""))
            if len(octets) == {socket.AF_INET: 4, socket.AF_INET6: 16}.get(family):
                yield scope >= BEYOND_LINK, family, number, f"{socket.inet_ntop(family, octets)}/{prefix}"
        at += length + 3 & ~3


def _attributes(octets: bytes) -> Iterator[tuple[int, bytes]]:
    at = 0
    while at + ATTRIBUTE.size <= len(octets):
        length, kind = ATTRIBUTE.unpack_from(octets, at)
        if length < ATTRIBUTE.size:
            return
        yield kind, octets[at + ATTRIBUTE.size : at + length]
        at += length + 3 & ~3
