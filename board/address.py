"""Addresses as they are written: host and port, IPv4 and port, six octets of a device, and its name."""

import ipaddress
import os
from typing import NamedTuple

from board.errors import ConfigurationError
from board.toml import show

IFNAMSIZ = 16  # of linux/if.h: octets of a network device's name, with the zero behind it
NOT_IN_DEVICES = frozenset(b"/:\t\n\v\f\r \xa0")
MOST_SOCKET_PATH = 107  # octets, before the zero that ends it: sun_path of unix(7)


class Address(NamedTuple):
    """An IPv4 address and a UDP port."""

    host: str
    port: int

    def __str__(self) -> str:
        return f"{self.host}:{self.port}"


def host_and_port(text: str) -> tuple[str, str]:
    """Both parts of `HOST`, `HOST:PORT`, `:PORT`, `V6`, `[V6]:PORT`; what is not written is empty."""
    if text.startswith("["):
        host, _, rest = text[1:].partition("]")
        return host, rest.removeprefix(":")
    if text.count(":") > 1:
        return text, ""
    host, _, port = text.partition(":")
    return host, port


def address(text: str) -> Address:
    """The address in `127.0.0.1:8947`. Raises ConfigurationError; names are not resolved, that could take seconds."""
    host, port = host_and_port(text)
    is_port = port.isascii() and port.isdecimal() and len(port) < 6 and int(port) <= 65535
    if text.startswith("[") or not is_ipv4(host) or not is_port:
        raise ConfigurationError(f'"{text}" is no IPv4 address and port', "write for example 127.0.0.1:8947")
    return Address(host, int(port))


def is_ipv4(text: str) -> bool:
    """Whether a text is an IPv4 address, and not the name of a network device."""
    try:
        ipaddress.IPv4Address(text)
    except ValueError:
        return False
    return True


def mac_address(text: str) -> bytes:
    """The six octets of one station's address, written as 02:00:00:00:00:0b. Raises ConfigurationError."""
    parts = text.split(":")
    try:
        octets = bytes.fromhex("".join(parts))
    except ValueError:
        octets = b""
    if [len(part) for part in parts] != [2] * 6 or len(octets) != 6 or octets[0] & 1 or not any(octets):
        raise ConfigurationError(f'"{text}" is no address of one station', "write for example 02:00:00:00:00:0b")
    return octets


def check_device_name(text: str) -> None:
    """Raises ConfigurationError for what no network device can be called.

    Source: Linux, net/core/dev.c, dev_valid_name(), and lib/ctype.c. A zero is told of all texts alike, where they are
    read.
    """
    octets = text.encode(errors="replace")
    if not 0 < len(octets) < IFNAMSIZ or octets in (b".", b"..") or set(octets) & NOT_IN_DEVICES:
        raise ConfigurationError(f"{show(text)} is no name of a network device", "`ip -brief link` lists them")


def check_socket_path(path: str) -> None:
    """Raises ConfigurationError with the length of a path that no Unix socket can have."""
    if (octets := len(os.fsencode(path))) > MOST_SOCKET_PATH:
        what = f"socket path too long: {octets} octets: {show(path)}"
        raise ConfigurationError(what, f"use at most {MOST_SOCKET_PATH}")
