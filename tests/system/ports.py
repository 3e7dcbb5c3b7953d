"""Ports of loopback that no other test, and no program on this machine, is given while they are held."""

import random
import socket

from board.free_udp import choice


class Ports:
    """TCP ports, kept by sockets that are bound and never listen.

    Bound without SO_REUSEADDR, so that nobody else is given the port; the option is set afterwards, so that the
    station, whose sockets do carry it, may listen there all the same. UDP has no such way: a socket that keeps the port
    would hear in the station's place. So the ports are none of those that the kernel gives to programs.
    """

    def __init__(self) -> None:
        self._held: list[socket.socket] = []

    def take(self) -> int:
        """A TCP port whose number is free for UDP as well."""
        ports = choice()
        while True:
            port = random.choice(ports)
            holder = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
            if _binds(holder, port) and _is_free(port, socket.SOCK_DGRAM):
                holder.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                self._held.append(holder)
                return port
            holder.close()

    def release(self) -> None:
        while self._held:
            self._held.pop().close()


def is_free(port: int) -> bool:
    """Whether nobody has it, for TCP or UDP, or holds it."""
    return _is_free(port, socket.SOCK_STREAM) and _is_free(port, socket.SOCK_DGRAM)


def _is_free(port: int, kind: socket.SocketKind) -> bool:
    with socket.socket(socket.AF_INET, kind) as probe:
        return _binds(probe, port)


def _binds(one: socket.socket, port: int) -> bool:
    try:
        one.bind(("127.0.0.1", port))
    except OSError:
        return False
    return True
