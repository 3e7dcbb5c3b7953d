"""Ports that no other test, and no program on this machine, is given while they are held."""

import socket


class Ports:
    """TCP ports on loopback, kept by sockets that are bound and never listen.

    Bound without SO_REUSEADDR, so that nobody else is given the port; the option is set afterwards, so that the
    station, whose sockets do carry it, may listen there all the same.
    """

    def __init__(self) -> None:
        self._held: list[socket.socket] = []

    def take(self) -> int:
        """A TCP port whose number is free for UDP as well."""
        while True:
            holder = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
            holder.bind(("127.0.0.1", 0))
            holder.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            self._held.append(holder)
            port: int = holder.getsockname()[1]
            if _is_free_for_udp(port):
                return port

    def release(self) -> None:
        while self._held:
            self._held.pop().close()


def _is_free_for_udp(port: int) -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(("127.0.0.1", port))
        except OSError:
            return False
    return True
