"""Reads and checks box.toml, the owner's settings of the box."""

import ipaddress
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from board.runtime.describe import Check
from board.runtime.errors import ConfigurationError
from board.runtime.toml import show

ZONES = Path("/usr/share/zoneinfo")
# Entries of that folder that are not selectable zones: the machine's own, copies of all zones, and the one for "not
# set".
NO_ZONES = ("localtime", "posixrules", "posix", "right", "Factory")
# RFC 1123, clause 2.1; a single label, because mDNS adds .local.
NAME = re.compile(r"[A-Za-z0-9](?:[A-Za-z0-9-]{0,61}[A-Za-z0-9])?")
# Form that inet_aton(3) parses as an address.
NUMBER = re.compile(r"[0-9]+|0[xX][0-9A-Fa-f]*")
# ISO 3166-1, the codes of the kernel's database of regulatory domains.
REGION = re.compile(r"[A-Z]{2}")
MOST_SSID = 32  # octets: IEEE 802.11, clause 9.4.2.2
PHRASE = range(8, 64)  # characters: IEEE 802.11, clause J.4.1
PSK = re.compile(r"[0-9A-Fa-f]{64}")
BROADCAST = ipaddress.IPv4Address("255.255.255.255")
Address = ipaddress.IPv4Address | ipaddress.IPv6Address
TABLE = Path("/usr/share/zoneinfo/iso3166.tab")


def check_host_name(text: str) -> None:
    """Check a host name. Raises ConfigurationError for an invalid label (RFC 1123, clause 2.1)."""
    if text.lower() == "localhost" or NUMBER.fullmatch(text):
        what = f"invalid host name: {show(text)}: it reads as an address"
        raise ConfigurationError(what, "write for example captain-7")
    if not NAME.fullmatch(text):
        near = re.sub(r"[^A-Za-z0-9]+", "-", text.removesuffix(".local")).strip("-")[:63]
        hint = f"write {near}" if near else "write for example captain-7"
        raise ConfigurationError(f"invalid host name: {show(text)}: use letters, digits, and - between them", hint)


def check_country(text: str) -> None:
    """Check a country. Raises ConfigurationError for a code that ISO 3166-1 does not have."""
    if _is_country(text):
        return
    hint = 'two capital letters of ISO 3166, such as "DE"'
    if text.upper() == "UK":
        hint = "the United Kingdom is GB"
    elif _is_country(text.upper()):
        hint = f"write {text.upper()}"
    raise ConfigurationError(f"unknown country: {show(text)}", hint)


def check_time_zone(text: str) -> None:
    """Check a time zone. Raises ConfigurationError for an unknown one.

    Without /usr/share/zoneinfo, only the form is checked.
    """
    is_name = re.fullmatch(r"[A-Za-z0-9_+-]+(?:/[A-Za-z0-9_+-]+)*", text) and text.partition("/")[0] not in NO_ZONES
    if is_name and (not ZONES.is_dir() or _is_zone(ZONES / text)):
        return
    raise ConfigurationError(
        f"unknown time zone: {show(text)}", 'write for example "Europe/Berlin", or leave it out for UTC'
    )


def check_ssid(text: str) -> None:
    """Check an SSID. Raises ConfigurationError for an SSID that is empty or longer than MOST_SSID octets."""
    if not 1 <= (size := len(text.encode())) <= MOST_SSID:
        raise ConfigurationError(f"{show(text)} has {size} octets", f"use 1 to {MOST_SSID}")


def check_password(value: object) -> None:
    """Check a passphrase of WPA. Raises ConfigurationError, without the value, for an invalid one.

    Source: IEEE 802.11, clause J.4.1.
    """
    if not isinstance(value, str):
        raise ConfigurationError("is not text", 'write it in quotes: password = "..."')
    if PSK.fullmatch(value):
        return
    if strange := [letter for letter in value if not " " <= letter <= "~"]:
        where = value.index(strange[0]) + 1
        raise ConfigurationError(f"character {where} is not allowed in WPA", "use letters, digits and signs of ASCII")
    if len(value) not in PHRASE:
        hint = "WPA needs 8 to 63; for an open network leave the password out"
        raise ConfigurationError(f"has {len(value)} characters", hint)


def check_psk(value: object) -> None:
    """Check a PSK. Raises ConfigurationError, without the value, unless it has 64 hexadecimal digits."""
    if not isinstance(value, str) or not PSK.fullmatch(value):
        raise ConfigurationError("is not 64 hexadecimal digits", "or write the password itself: password = ...")


def check_interface_address(text: str) -> None:
    """Check an interface's address. Raises ConfigurationError unless it is a host's, with a prefix length."""
    try:
        found = ipaddress.ip_interface(text)
    except ValueError as error:
        raise ConfigurationError(f"invalid address: {show(text)}", 'write for example "10.0.0.20/24"') from error
    _check_host(found.ip, text)
    hint = f'write for example "{_usual(found.ip)}"'
    if "/" not in text:
        raise ConfigurationError(f"{show(text)} has no prefix length", hint)
    if found.network.prefixlen == 0:
        raise ConfigurationError(f"{show(text)} has prefix length 0", hint)
    if found.network.num_addresses > 2 and found.ip in (found.network.network_address, found.network.broadcast_address):
        raise ConfigurationError(f"{show(text)} is a network or broadcast address", "give the address of one host")


def check_plain_address(text: str) -> None:
    """Check the address of another host. Raises ConfigurationError if it is invalid or no host can have it."""
    try:
        found = ipaddress.ip_address(text)
    except ValueError as error:
        raise ConfigurationError(f"invalid address: {show(text)}", 'write for example "10.0.0.1"') from error
    _check_host(found, text)


def _check_host(found: Address, text: str) -> None:
    """Check that a host can have the address; refuse zones, whose letters would get into files of other programs."""
    if "%" in text:
        raise ConfigurationError(f"{show(text)} has a zone", 'leave out the part from "%" on')
    if found.is_multicast or found.is_unspecified or found.is_loopback or found == BROADCAST:
        raise ConfigurationError(f"{show(text)} is not the address of a host", "correct it")


def check_server(text: str) -> None:
    """Check a server. Raises ConfigurationError for an invalid host name or address."""
    if re.fullmatch(r"[0-9.]+|.*:.*", text):
        check_plain_address(text)
    elif len(text) > 253 or not all(NAME.fullmatch(label) for label in text.removesuffix(".").split(".")):
        raise ConfigurationError(f"invalid host: {show(text)}", 'write for example "ptbtime1.ptb.de"')


@dataclass(frozen=True)
class Wifi:
    """[wifi]: the network that wlan0 joins. An open network has neither password nor psk.

    country   two letters of ISO 3166, such as "DE".
    ssid      name of the network.
    password  passphrase of WPA, 8 to 63 characters.
    psk       64 hexadecimal digits in place of the password; Raspberry Pi Imager writes them.
    hidden    the network does not send its name.

    Raises ConfigurationError if both password and psk are given.
    """

    country: Annotated[str, Check(check_country)]
    ssid: Annotated[str, Check(check_ssid)]
    password: Annotated[object, Check(check_password)] = None
    psk: Annotated[object, Check(check_psk)] = None
    hidden: bool = False

    def __post_init__(self) -> None:
        if self.password is not None and self.psk is not None:
            raise ConfigurationError("psk: conflicts with password", "leave one out")


@dataclass(frozen=True)
class ConsoleOptions:
    """[console]: the serial console.

    shell  a key opens a shell.
    """

    shell: bool = True


@dataclass(frozen=True)
class Ethernet:
    """[eth0]: a fixed address, in place of DHCP.

    address  address with prefix length: "10.0.0.20/24".
    gateway  address of the router.
    dns      addresses of DNS servers.

    Raises ConfigurationError if the gateway is not another host of its network.
    """

    address: Annotated[str, Check(check_interface_address)]
    gateway: Annotated[str, Check(check_plain_address)] | None = None
    dns: tuple[Annotated[str, Check(check_plain_address)], ...] = ()

    def __post_init__(self) -> None:
        if self.gateway is None:
            return
        network, gateway = ipaddress.ip_interface(self.address).network, ipaddress.ip_address(self.gateway)
        if gateway.version == 6 == network.version and gateway.is_link_local:
            return  # routers announce themselves by link-local addresses; RFC 4861, 4.2
        if network.num_addresses == 1:
            what = f'gateway: "{gateway}" is not in {network}, which has one address'
            hint = f"write the prefix length in address, such as {_usual(network.network_address)}"
            raise ConfigurationError(what, hint)
        if gateway not in network:
            raise ConfigurationError(f'gateway: "{gateway}" is not in the network {network} of the box', "correct one")
        ends = (network.network_address, network.broadcast_address) if network.num_addresses > 2 else ()
        if gateway == ipaddress.ip_interface(self.address).ip or gateway in ends:
            raise ConfigurationError(f'gateway: "{gateway}" is not another host of the network {network}', "correct it")


@dataclass(frozen=True)
class BoxOptions:
    """All options of box.toml. Without an option, the image's default applies.

    host_name     name of the box, without .local.
    time_zone     time zone of ssh sessions, such as "Europe/Berlin". The station uses UTC.
    wifi          Wi-Fi network. Left out: no Wi-Fi.
    console       the serial console.
    eth0          fixed address of eth0. Left out: DHCP.
    time_servers  NTP servers, beside the pulses. Without a receiver only they set the clock.
    """

    host_name: Annotated[str, Check(check_host_name)] | None = None
    time_zone: Annotated[str, Check(check_time_zone)] | None = None
    wifi: Wifi | None = None
    console: ConsoleOptions = ConsoleOptions()
    eth0: Ethernet | None = None
    time_servers: tuple[Annotated[str, Check(check_server)], ...] = ()


def _usual(address: Address) -> str:
    return f"{address}/{24 if address.version == 4 else 64}"


def _is_zone(path: Path) -> bool:
    """Return whether a file is a time zone, by its first octets; other files are tables of zones. Source: tzfile(5)."""
    return path.is_file() and path.read_bytes()[:4] == b"TZif"


def _is_country(text: str) -> bool:
    """Return whether a country is in this machine's list; without a list, check the form only."""
    if not REGION.fullmatch(text):
        return False
    try:
        lines = TABLE.read_text(encoding="utf-8").splitlines()
    except OSError:
        return True
    return any(line.startswith(f"{text}\t") for line in lines)
