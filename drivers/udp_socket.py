"""UDP sockets of an interface: opened, shared between lanes, joined to a group."""

import errno
import ipaddress
import socket
import struct
from contextlib import ExitStack

from board.address import Address, address, is_ipv4
from board.errors import ConfigurationError
from drivers.intake import refused
from drivers.lanes import Program, steer

# A group's datagrams stay on the link: ITS messages go one hop.
MULTICAST_TTL = 1


def group_address(text: str) -> Address:
    """As address(), of a multicast group."""
    group = address(text)
    if not ipaddress.IPv4Address(group.host).is_multicast:
        raise ConfigurationError(f'"{text}" is no multicast group', "those are 224.0.0.0 to 239.255.255.255")
    return group


def open_unicast(at: Address, count: int, lane: Program) -> list[socket.socket]:
    """As many sockets bound to one address; the program returns the place of the one that gets a datagram.

    Raises InterfaceError when the address is taken or not ours. SO_REUSEPORT would let two processes of one user
    share a port without a word, each with a part of the datagrams: so the first bind is one without it.
    """
    with ExitStack() as opened:
        try:
            with _udp() as probe:
                probe.bind(at)
                at = Address(at.host, probe.getsockname()[1])
            lanes = [opened.enter_context(_udp()) for _ in range(count)]
            for one in lanes:
                one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
                one.bind(at)
            steer(lanes[0], lane)
        except OSError as error:
            raise _bind_error(at, error) from error
        opened.pop_all()
    return lanes


def open_group(group: Address, device: str) -> socket.socket:
    """One socket that hears a multicast group by one device, and shares the port with other stations of this host.

    device  name of a network device or an IPv4 address of it; empty: the kernel's route decides.

    One socket only: of a group the kernel gives every socket a copy, and what a filter rejects it counts among the
    socket's drops. With a socket for each lane the sums would no longer tell what was lost.
    """
    with ExitStack() as opened:
        receiver = opened.enter_context(_udp())
        try:
            receiver.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            receiver.bind(group)
            receiver.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, _membership(group.host, device))
        except OSError as error:
            raise refused(f"group {group} by {device or 'the default route'}", error, _group_hint(error)) from error
        opened.pop_all()
    return receiver


def open_sender(to: Address, device: str = "") -> socket.socket:
    """A connected socket: send() costs less than sendto(), and the kernel tells when nobody listens there."""
    with ExitStack() as opened:
        sender = opened.enter_context(_udp())
        try:
            if ipaddress.IPv4Address(to.host).is_multicast:
                sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, _membership("0.0.0.0", device))
                sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, MULTICAST_TTL)
                sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_LOOP, 1)  # other stations of this host
            sender.connect(to)
        except OSError as error:
            raise refused(f"peer {to}", error, "is there a route?") from error
        opened.pop_all()
    return sender


def _udp() -> socket.socket:
    return socket.socket(socket.AF_INET, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK | socket.SOCK_CLOEXEC)


def _membership(group: str, device: str) -> bytes:
    """struct ip_mreqn of ip(7): group, local address, index of the device."""
    index, local = 0, "0.0.0.0"
    if is_ipv4(device):
        local = device
    elif device:
        index = _index(device)
    return struct.pack("=4s4si", socket.inet_aton(group), socket.inet_aton(local), index)


def _index(device: str) -> int:
    try:
        return socket.if_nametoindex(device)
    except OSError as error:
        raise OSError(errno.ENODEV, "no such network device") from error


def _bind_error(at: Address, error: OSError) -> Exception:
    if error.errno == errno.EADDRINUSE:
        return refused(f"port already taken: {at}", error, f"`ss -ulpn sport = :{at.port}` names who has it")
    hint = "no device of this host has the address" if error.errno == errno.EADDRNOTAVAIL else ""
    return refused(f"cannot listen at {at}", error, hint)


def _group_hint(error: OSError) -> str:
    if error.errno == errno.EADDRINUSE:
        return "another program has the port for itself"
    return "name the network device in the option device"
