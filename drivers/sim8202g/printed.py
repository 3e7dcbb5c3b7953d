"""Parsers for the output of a bearer's programs: ip, udhcpc, qmicli, mbimcli."""

import re
from ipaddress import IPv4Network
from typing import NamedTuple

from drivers.sim8202g.script import StepError

# Output of udhcpc when it has a lease. busybox before 1.34 writes a capital letter.
LEASE = r"[Ll]ease of [0-9.]+ obtained"

# Address in the output of `ip -o addr`, of iproute2 and of busybox.
ADDRESS = re.compile(r" inet6? ([0-9a-f.:]+)")

# Values in the output of qmicli and mbimcli.
HANDLE = re.compile(r"Packet data handle: '?(\d+)")
CLIENT = re.compile(r"CID: '?(\d+)")
_QMI_ADDRESS = re.compile(r"IPv4 address: ([0-9.]+)")
_QMI_MASK = re.compile(r"IPv4 subnet mask: ([0-9.]+)")
_QMI_GATEWAY = re.compile(r"IPv4 gateway address: ([0-9.]+)")
_MTU = re.compile(r"MTU: '?(\d+)")
_QMI_ADDRESS6 = re.compile(r"IPv6 address: ([0-9A-Fa-f:]+/\d+)")
_MBIM_ADDRESS = re.compile(r"IP \[0\]: '([0-9A-Fa-f.:]+/\d+)'")
_MBIM_GATEWAY = re.compile(r"Gateway: '([0-9A-Fa-f.:]+)'")


class Settings(NamedTuple):
    """Settings that the network assigned.

    address  IP address with prefix length, such as `10.64.1.2/30`.
    gateway  IP address of the gateway; empty without one.
    mtu      octets.
    """

    address: str
    gateway: str
    mtu: int


def qmi_settings(printed: str) -> Settings:
    """Parse the output of `qmicli --wds-get-current-settings`. Raises StepError if it has no address."""
    mtu = _MTU.search(printed)
    size = int(mtu[1]) if mtu else 1500
    if (address6 := _QMI_ADDRESS6.search(printed)) and not _QMI_ADDRESS.search(printed):
        return Settings(address6[1], "", size)
    address, mask = value(_QMI_ADDRESS, printed, "qmicli"), value(_QMI_MASK, printed, "qmicli")
    gateway = _QMI_GATEWAY.search(printed)
    try:
        prefix = IPv4Network(f"0.0.0.0/{mask}").prefixlen
    except ValueError as error:
        raise StepError(f"qmicli: invalid mask: {mask}") from error
    return Settings(f"{address}/{prefix}", gateway[1] if gateway else "", size)


def mbim_settings(printed: str) -> Settings:
    """Parse the output of `mbimcli --connect`. Raises StepError if it has no address."""
    mtu, gateway = _MTU.search(printed), _MBIM_GATEWAY.search(printed)
    address = value(_MBIM_ADDRESS, printed, "mbimcli")
    return Settings(address, gateway[1] if gateway else "", int(mtu[1]) if mtu else 1500)


def value(pattern: re.Pattern[str], text: str, tool: str) -> str:
    """Return the first group of a pattern in the output of a tool. Raises StepError if the pattern does not match."""
    match = pattern.search(text)
    if match is None:
        raise StepError(f"{tool} did not print {pattern.pattern.partition(':')[0]}", f"check the version of {tool}")
    return match[1]
