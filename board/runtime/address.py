"""Addresses as text: host and port, MAC address, network device."""

import ipaddress
import os
from typing import NamedTuple

from board.runtime.errors import ConfigurationError
from board.runtime.toml import show

IFNAMSIZ = 16  # linux/if.h: octets of a network device's name, including the terminating zero
NOT_IN_DEVICES = frozenset(b"/:\t\n\v\f\r \xa0")
MOST_SOCKET_PATH = 107  # octets without the terminating zero: sun_path of unix(7)


class Address(NamedTuple):
    """An IPv4 address and a UDP port."""

    host: str
    port: int

    def __str__(self) -> str:
        return f"{self.host}:{self.port}"


def host_and_port(text: str) -> tuple[str, str]:
    """Split `HOST`, `HOST:PORT`, `:PORT`, `V6` or `[V6]:PORT` into host and port; a missing part is empty."""
    if text.startswith("["):
        host, _, rest = text[1:].partition("]")
        return host, rest.removeprefix(":")
    if text.count(":") > 1:
        return text, ""
    host, _, port = text.partition(":")
    return host, port


def address(text: str) -> Address:
    """Parse `127.0.0.1:8947`. Raises ConfigurationError if invalid; also for names, which take seconds to resolve."""
    host, port = host_and_port(text)
    is_port = port.isascii() and port.isdecimal() and len(port) < 6 and int(port) <= 65535
    if text.startswith("[") or not is_ipv4(host) or not is_port:
        raise ConfigurationError(f'invalid IPv4 address and port: "{text}"', "write for example 127.0.0.1:8947")
    return Address(host, int(port))


def is_ipv4(text: str) -> bool:
    """Return whether a text is an IPv4 address; else it may be the name of a network device."""
    try:
        ipaddress.IPv4Address(text)
    except ValueError:
        return False
    return True


def mac_address(text: str) -> bytes:
    """Return the six octets of a station's MAC address, written as 02:00:00:00:00:0b.

    Raises ConfigurationError for another form, a group address, or an address of zeros.
    """
    parts = text.split(":")
    try:
        octets = bytes.fromhex("".join(parts))
    except ValueError:
        octets = b""
    if [len(part) for part in parts] != [2] * 6 or len(octets) != 6 or octets[0] & 1 or not any(octets):
        raise ConfigurationError(f'invalid MAC address of a station: "{text}"', "write for example 02:00:00:00:00:0b")
    return octets


def check_device_name(text: str) -> None:
    """Check a network device's name. Raises ConfigurationError if Linux would refuse it.

    A NUL in the name is reported where the text is read, as for all texts.
    Source: Linux, net/core/dev.c, dev_valid_name(), and lib/ctype.c.
    """
    octets = text.encode(errors="replace")
    if not 0 < len(octets) < IFNAMSIZ or octets in (b".", b"..") or set(octets) & NOT_IN_DEVICES:
        raise ConfigurationError(f"invalid name of a network device: {show(text)}", "`ip -brief link` lists them")


def check_socket_path(path: str) -> None:
    """Check the length of a Unix socket's path. Raises ConfigurationError with the length if it is too long."""
    if (octets := len(os.fsencode(path))) > MOST_SOCKET_PATH:
        what = f"socket path too long: {octets} octets: {show(path)}"
        raise ConfigurationError(what, f"use at most {MOST_SOCKET_PATH}")
