"""Ports of a station: finds free ones, and the station that uses others."""

import socket
from collections.abc import Iterator, Mapping
from pathlib import Path

from board.runtime.errors import StationError
from firmware.client import client
from firmware.endpoint.control.control_socket import default_paths
from firmware.untrusted import number, text


def is_free(host: str, port: int) -> bool:
    """Whether a station could listen at a port.

    SO_REUSEADDR is set as in libzmq, so that closed connections do not count.
    """
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_STREAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError:
            return False
    return True


def running(from_users: int, control: str = "") -> dict[str, object] | None:
    """Return the status of the running station on this machine that has this port; None without one."""
    for path in [control] if control else default_paths(from_users):
        try:
            return client.station_status(Path(path))
        except StationError:
            continue  # no station answers at this path
    return None


def holder(status: Mapping[str, object]) -> str:
    """Return a name for a running station: station name and process id."""
    return f"station {text(status, 'station')!r}, pid {number(status, 'pid'):.0f}"


def free_blocks(host: str, first: int, count: int) -> Iterator[int]:
    """Yield the first port of each block of `count` free ports, from `first` on in steps of ten.

    Raises StationError if no further block is free.
    """
    for start in range(first, 0xFFFF - count, 10):
        if all(is_free(host, port) for port in range(start, start + count)):
            yield start
    raise StationError(f"no {count} free ports in a row on {host} from {first} on")
