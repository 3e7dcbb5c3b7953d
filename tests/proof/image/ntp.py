"""A time server for the guest: what this machine's clock says. Source: RFC 5905, figure 8."""

import socket
import struct
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

SINCE_1900_S = 2_208_988_800
PACKET = struct.Struct(">BBbbII4sQQQQ")
SERVER, VERSION = 4, 4


@contextmanager
def serving() -> Iterator[int]:
    """Its port on loopback."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as server:
        server.bind(("127.0.0.1", 0))
        threading.Thread(target=_serve, args=(server,), daemon=True).start()
        yield int(server.getsockname()[1])


def _serve(server: socket.socket) -> None:
    while True:
        try:
            octets, peer = server.recvfrom(1024)
        except OSError:
            return  # it was closed
        received = _now()
        if len(octets) < PACKET.size:
            continue
        theirs = PACKET.unpack_from(octets)[-1]
        head = (VERSION << 3 | SERVER, 1, 6, -20, 0, 1, b"GPS\0")
        server.sendto(PACKET.pack(*head, received - (1 << 32), theirs, received, _now()), peer)


def _now() -> int:
    """As NTP writes it: seconds since 1900, and 32 bits of fraction."""
    return round((time.time() + SINCE_1900_S) * (1 << 32))
