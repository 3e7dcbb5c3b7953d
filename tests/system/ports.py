"""Ports of loopback that are reserved for a test while they are held."""

import random
import socket

from board.runtime.free_udp import choice


class Ports:
    """Reserved TCP ports, held by sockets that are bound and never listen.

    The sockets are bound without SO_REUSEADDR, so that the kernel gives the port to no other program. Afterwards the
    option is set, so that the station, whose sockets have it as well, can listen at the port. UDP ports cannot be held
    like this, because the holding socket would receive the station's datagrams. The ports are therefore outside of the
    range from which the kernel chooses ports for programs.
    """

    def __init__(self) -> None:
        self._held: list[socket.socket] = []

    def take(self) -> int:
        """Reserve a TCP port whose number is free for UDP as well."""
        return self.take_row(1)[0]

    def take_row(self, count: int) -> list[int]:
        """Reserve consecutive TCP ports whose numbers are free for UDP as well."""
        ports = choice()
        while True:
            first = random.choice(range(ports.start, ports.stop - count + 1))
            row = list(range(first, first + count))
            holders = [socket.socket(socket.AF_INET, socket.SOCK_STREAM) for _ in row]
            if all(
                _binds(holder, port) and _is_free(port, socket.SOCK_DGRAM)
                for holder, port in zip(holders, row, strict=True)
            ):
                for holder in holders:
                    holder.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                self._held += holders
                return row
            for holder in holders:
                holder.close()

    def release(self) -> None:
        while self._held:
            self._held.pop().close()


def is_free(port: int) -> bool:
    """Return True if no socket is bound to the port, neither TCP nor UDP."""
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
