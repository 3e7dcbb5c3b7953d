"""box.toml: what an owner says of the box around the station, read and checked."""

import ipaddress
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from board.describe import Check
from board.errors import ConfigurationError
from board.toml import show

ZONES = Path("/usr/share/zoneinfo")
# There as well: what a machine has for itself, copies of all zones, and one that says that none was chosen.
NO_ZONES = ("localtime", "posixrules", "posix", "right", "Factory")
# RFC 1123, clause 2.1; one label, for mDNS adds .local.
NAME = re.compile(r"[A-Za-z0-9](?:[A-Za-z0-9-]{0,61}[A-Za-z0-9])?")
# What inet_aton(3) takes for an address.
NUMBER = re.compile(r"[0-9]+|0[xX][0-9A-Fa-f]*")
# ISO 3166-1, as the kernel's database of regulatory domains has them.
REGION = re.compile(r"[A-Z]{2}")
MOST_SSID = 32  # octets: IEEE 802.11, clause 9.4.2.2
PHRASE = range(8, 64)  # characters: IEEE 802.11, clause J.4.1
PSK = re.compile(r"[0-9A-Fa-f]{64}")
BROADCAST = ipaddress.IPv4Address("255.255.255.255")
Address = ipaddress.IPv4Address | ipaddress.IPv6Address
TABLE = Path("/usr/share/zoneinfo/iso3166.tab")


def check_host_name(text: str) -> None:
    """Raises ConfigurationError, as the others here do."""
    if text.lower() == "localhost" or NUMBER.fullmatch(text):
        what = f"{show(text)} means an address, and is no host name"
        raise ConfigurationError(what, "write for example captain-7")
    if not NAME.fullmatch(text):
        near = re.sub(r"[^A-Za-z0-9]+", "-", text.removesuffix(".local")).strip("-")[:63]
        hint = f"write {near}" if near else "write for example captain-7"
        raise ConfigurationError(f"{show(text)} is no host name: letters, digits, and - between them", hint)


def check_country(text: str) -> None:
    if _is_country(text):
        return
    hint = 'two capital letters of ISO 3166, such as "DE"'
    if text.upper() == "UK":
        hint = "the United Kingdom is GB"
    elif _is_country(text.upper()):
        hint = f"write {text.upper()}"
    raise ConfigurationError(f"{show(text)} is no country", hint)


def check_time_zone(text: str) -> None:
    is_name = re.fullmatch(r"[A-Za-z0-9_+-]+(?:/[A-Za-z0-9_+-]+)*", text) and text.partition("/")[0] not in NO_ZONES
    if is_name and (not ZONES.is_dir() or _is_zone(ZONES / text)):
        return
    raise ConfigurationError(
        f"{show(text)} is no time zone", 'write for example "Europe/Berlin", or leave it out for UTC'
    )


def check_ssid(text: str) -> None:
    if not 1 <= (size := len(text.encode())) <= MOST_SSID:
        raise ConfigurationError(f"{show(text)} has {size} octets", f"the name of a network has 1 to {MOST_SSID}")


def check_password(value: object) -> None:
    """Its value is never told."""
    if not isinstance(value, str):
        raise ConfigurationError("is no text", 'write it in quotes: password = "..."')
    if PSK.fullmatch(value):
        return
    if strange := [letter for letter in value if not " " <= letter <= "~"]:
        where = value.index(strange[0]) + 1
        raise ConfigurationError(f"character {where} is none that WPA takes", "only letters, digits and signs of ASCII")
    if len(value) not in PHRASE:
        hint = "WPA wants 8 to 63; of an open network leave the password out"
        raise ConfigurationError(f"has {len(value)} characters", hint)


def check_psk(value: object) -> None:
    if not isinstance(value, str) or not PSK.fullmatch(value):
        raise ConfigurationError("is not 64 hexadecimal digits", "or write the password itself: password = ...")


def check_interface_address(text: str) -> None:
    try:
        found = ipaddress.ip_interface(text)
    except ValueError as error:
        raise ConfigurationError(f"{show(text)} is no address", 'write for example "10.0.0.20/24"') from error
    _check_host(found.ip, text)
    hint = f'write for example "{_usual(found.ip)}"'
    if "/" not in text:
        raise ConfigurationError(f"{show(text)} has no length of its network", hint)
    if found.network.prefixlen == 0:
        raise ConfigurationError(f"{show(text)} has the whole world as its network", hint)
    if found.network.num_addresses > 2 and found.ip in (found.network.network_address, found.network.broadcast_address):
        raise ConfigurationError(f"{show(text)} is the address of a whole network", "give one of it to the box")


def check_plain_address(text: str) -> None:
    try:
        found = ipaddress.ip_address(text)
    except ValueError as error:
        raise ConfigurationError(f"{show(text)} is no address", 'write for example "10.0.0.1"') from error
    _check_host(found, text)


def _check_host(found: Address, text: str) -> None:
    """A zone, which may hold any letter, would get into files of other programs."""
    if "%" in text:
        raise ConfigurationError(f"{show(text)} names a zone", 'leave out what begins with "%"')
    if found.is_multicast or found.is_unspecified or found.is_loopback or found == BROADCAST:
        raise ConfigurationError(f"{show(text)} is no address that another host can have", "correct it")


def check_server(text: str) -> None:
    """A host by its name or its address."""
    if re.fullmatch(r"[0-9.]+|.*:.*", text):
        check_plain_address(text)
    elif len(text) > 253 or not all(NAME.fullmatch(label) for label in text.removesuffix(".").split(".")):
        raise ConfigurationError(f"{show(text)} is no host", 'write for example "ptbtime1.ptb.de"')


@dataclass(frozen=True)
class Wifi:
    """[wifi]: the network that wlan0 joins. Neither password nor psk: an open one.

    psk     64 hexadecimal digits that stand for network and password; Raspberry Pi Imager writes them.
    hidden  its name is not sent out: it is asked for by name.
    """

    country: Annotated[str, Check(check_country)]
    ssid: Annotated[str, Check(check_ssid)]
    password: Annotated[object, Check(check_password)] = None
    psk: Annotated[object, Check(check_psk)] = None
    hidden: bool = False

    def __post_init__(self) -> None:
        if self.password is not None and self.psk is not None:
            raise ConfigurationError("psk: is given beside password", "leave one out")


@dataclass(frozen=True)
class ConsoleOptions:
    """[console]: shell = false takes the key for a shell from the serial console."""

    shell: bool = True


@dataclass(frozen=True)
class Ethernet:
    """[eth0]: an address of its own, in place of one by DHCP."""

    address: Annotated[str, Check(check_interface_address)]
    gateway: Annotated[str, Check(check_plain_address)] | None = None
    dns: tuple[Annotated[str, Check(check_plain_address)], ...] = ()

    def __post_init__(self) -> None:
        if self.gateway is None:
            return
        network, gateway = ipaddress.ip_interface(self.address).network, ipaddress.ip_address(self.gateway)
        if gateway.version == 6 == network.version and gateway.is_link_local:
            return  # as routers announce themselves; RFC 4861, 4.2
        if network.num_addresses == 1:
            what = f'gateway: no "{gateway}" is in {network}, which has one address'
            raise ConfigurationError(what, f"write its length in address, such as {_usual(network.network_address)}")
        if gateway not in network:
            raise ConfigurationError(f'gateway: "{gateway}" is not in the network {network} of the box', "correct one")
        ends = (network.network_address, network.broadcast_address) if network.num_addresses > 2 else ()
        if gateway == ipaddress.ip_interface(self.address).ip or gateway in ends:
            raise ConfigurationError(f'gateway: "{gateway}" is no other host of the network {network}', "correct it")


@dataclass(frozen=True)
class BoxOptions:
    """All of box.toml; what is left out stays as the image has it.

    time_servers  by NTP, beside the pulses: without a receiver nobody else sets the clock.
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
    """By the beginning of its content; beside zones there are tables of them. Source: tzfile(5)."""
    return path.is_file() and path.read_bytes()[:4] == b"TZif"


def _is_country(text: str) -> bool:
    """By this machine's list; where it has none, by the form."""
    if not REGION.fullmatch(text):
        return False
    try:
        lines = TABLE.read_text(encoding="utf-8").splitlines()
    except OSError:
        return True
    return any(line.startswith(f"{text}\t") for line in lines)
