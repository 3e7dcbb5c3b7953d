"""UDP ports for stations, simulators and laboratories of this machine: nobody has them, nor is given them meanwhile."""

import errno
import os
import random
import socket
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

from board.address import Address

# First and last of the ports that the kernel gives to whoever names none.
GIVEN = Path("/proc/sys/net/ipv4/ip_local_port_range")
LOWEST = 10_000  # below it are those of well-known programs
FEWEST = 1_000  # for many stations at once


def free_udp(host: str, count: int) -> list[Address]:
    """So many addresses whose port nobody has now, each another.

    Where there are enough others it is none of those that the kernel gives to programs, which might get it before its
    owner has opened it (ip(7), ip_local_port_range).

    host  an IPv4 address of this machine.
    Raises OSError: it is not this machine's, or all ports are taken.
    """
    found = [*islice((place for place in _places(host) if _is_free(place)), count)]
    if len(found) < count:
        raise OSError(errno.EADDRINUSE, os.strerror(errno.EADDRINUSE))
    return found


def choice() -> range:
    """Ports that no program has without naming them, where they are enough; else all. For TCP it is the same."""
    first, _ = map(int, GIVEN.read_text().split())
    return range(LOWEST, first) if first - LOWEST >= FEWEST else range(1024, 65_536)


def _places(host: str) -> Iterator[Address]:
    """All that are asked, from anywhere on: two programs at once begin at different ones."""
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
