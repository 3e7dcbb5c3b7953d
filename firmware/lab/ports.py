"""Ports of a station: which are free, and who has the others."""

import random
import socket
from collections.abc import Iterator, Mapping
from itertools import islice
from pathlib import Path

from board.errors import StationError
from firmware.control_socket import default_paths
from firmware.user import client
from firmware.user.untrusted import number, text

LOWEST = 10_000
GIVEN = Path("/proc/sys/net/ipv4/ip_local_port_range")  # first and last port of those that the kernel gives


def is_free(host: str, port: int) -> bool:
    """Whether a station could listen there; SO_REUSEADDR as libzmq has it, so that closed connections do not count."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_STREAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError:
            return False
    return True


def running(from_users: int, control: str = "") -> dict[str, object] | None:
    """The status of the station of this machine that has this port; None where no station says so."""
    for path in [control] if control else default_paths(from_users):
        try:
            return client.station_status(Path(path))
        except StationError:
            continue  # no station there
    return None


def holder(status: Mapping[str, object]) -> str:
    """A running station in words."""
    return f"station {text(status, 'station')!r}, pid {number(status, 'pid'):.0f}"


def free_blocks(host: str, first: int, count: int) -> Iterator[int]:
    """The first ports of blocks of `count` free ones, from `first` on in steps of ten.

    Raises StationError when there is none left.
    """
    for start in range(first, 0xFFFF - count, 10):
        if all(is_free(host, port) for port in range(start, start + count)):
            yield start
    raise StationError(f"no {count} free ports in a row on {host} from {first} on")


def free_udp(host: str, count: int) -> list[int]:
    """So many UDP ports that nobody has now, each another.

    None of those that the kernel gives whoever names none, where these leave others: until its station has opened a
    port, no other program is given it.

    Raises StationError when there are none left.
    """
    ports = _never_given()
    found = [*islice((port for port in random.sample(ports, len(ports)) if _is_free_for_udp(host, port)), count)]
    if len(found) < count:
        raise StationError(f"no {count} free UDP ports on {host}")
    return found


def _is_free_for_udp(host: str, port: int) -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind((host, port))
        except OSError:
            return False
    return True


def _never_given() -> range:
    """Ports that a program has only when it names them; all where the kernel gives nearly all (ip(7))."""
    first, _ = map(int, GIVEN.read_text().split())
    return range(LOWEST, first) if first >= 2 * LOWEST else range(1024, 65_536)
