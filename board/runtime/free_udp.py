"""Free UDP ports of this machine, reserved against other processes."""

import errno
import os
import random
import socket
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

from board.runtime.address import Address

# First and last port of the range from which the kernel assigns ports to sockets that bind none.
GIVEN = Path("/proc/sys/net/ipv4/ip_local_port_range")
LOWEST = 10_000  # well-known programs use ports below it
FEWEST = 1_000  # least number of ports, for many stations at once


def free_udp(host: str, count: int) -> list[Address]:
    """Return `count` addresses with different free ports.

    If possible, the ports lie outside the range that the kernel assigns to programs; else a program might get one
    before its owner opens it (ip(7), ip_local_port_range).

    host  an IPv4 address of this machine.

    Raises OSError if the address is not this machine's, or too few ports are free.
    """
    found = [*islice((place for place in _places(host) if _is_free(place)), count)]
    if len(found) < count:
        raise OSError(errno.EADDRINUSE, os.strerror(errno.EADDRINUSE))
    return found


def choice() -> range:
    """Return the ports outside the kernel's range if they suffice, else all. The same ports suit TCP."""
    first, _ = map(int, GIVEN.read_text().split())
    return range(LOWEST, first) if first - LOWEST >= FEWEST else range(1024, 65_536)


def _places(host: str) -> Iterator[Address]:
    """Return all candidates from a random start, so that two programs at once try different ones."""
    ports = choice()
    start = random.randrange(len(ports))
    return (Address(host, ports[(start + number) % len(ports)]) for number in range(len(ports)))


def _is_free(place: Address) -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(place)
        except OSError as error:
            if error.errno != errno.EADDRINUSE:
                raise
            return False
    return True
