"""UDP sockets: opens those for unicast lanes, for a multicast group, and for sending."""

import errno
import ipaddress
import socket
import struct
from contextlib import ExitStack

from board.runtime.address import Address, address, is_ipv4
from board.runtime.errors import ConfigurationError
from drivers.packet.intake import refused
from drivers.packet.lanes import Program, steer

# Datagrams to a group stay on the local link, because ITS messages go one hop.
MULTICAST_TTL = 1


def group_address(text: str) -> Address:
    """Parse `address:port` of a multicast group. Raises ConfigurationError if it is invalid or not multicast."""
    group = address(text)
    if not ipaddress.IPv4Address(group.host).is_multicast:
        raise ConfigurationError(f'not a multicast group: "{text}"', "groups are 224.0.0.0 to 239.255.255.255")
    return group


def open_unicast(at: Address, count: int, lane: Program) -> list[socket.socket]:
    """Bind several sockets to one address, one for each lane.

    at     address and port; with port 0 the kernel chooses one.
    count  number of sockets.
    lane   BPF program that returns the index of the socket for a datagram.

    Raises InterfaceError if the address is in use or does not belong to this machine. SO_REUSEPORT would let two
    processes of one user share a port unnoticed, and each would get a part of the datagrams. Therefore a first socket
    without that option tests the address.
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
    """Open a socket that receives a multicast group on one device. Other stations of this host may use the same port.

    device  name or IPv4 address of a network device; empty: the kernel's route decides.

    A group has one socket only. The kernel gives every socket of a group a copy, and counts copies that a filter
    rejects as drops of the socket. With a socket for each lane these counts would no longer show lost datagrams.

    Raises InterfaceError if the port is in use or the device does not exist.
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
    """Open a socket connected to a peer or group.

    On a connected socket send() costs less than sendto(), and the kernel reports if no program listens at the peer.

    device  name or IPv4 address of the network device, for a group; empty: the kernel's route decides.

    Raises InterfaceError if no route leads to the peer, or if the device does not exist.
    """
    with ExitStack() as opened:
        sender = opened.enter_context(_udp())
        try:
            if ipaddress.IPv4Address(to.host).is_multicast:
                sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, _membership("0.0.0.0", device))
                sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, MULTICAST_TTL)
                sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_LOOP, 1)  # to stations of this host
            sender.connect(to)
        except OSError as error:
            raise refused(f"peer {to}", error, "check the routes: ip route") from error
        opened.pop_all()
    return sender


def _udp() -> socket.socket:
    return socket.socket(socket.AF_INET, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK | socket.SOCK_CLOEXEC)


def _membership(group: str, device: str) -> bytes:
    """Return a struct ip_mreqn of ip(7): group, local address, index of the device."""
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
