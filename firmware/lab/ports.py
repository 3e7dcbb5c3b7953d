"""Ports of a station: which are free, and who has the others."""

import socket
from collections.abc import Iterator, Mapping
from pathlib import Path

from board.errors import StationError
from firmware.control_socket import default_paths
from firmware.user import client
from firmware.user.untrusted import number, text


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
