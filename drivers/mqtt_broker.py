"""Where a broker is: what the URL of one says."""

from ipaddress import ip_address
from typing import NamedTuple
from urllib.parse import SplitResult, urlsplit

from board.errors import ConfigurationError

PORTS = {"mqtt": 1883, "mqtts": 8883}  # IANA's, for a URL without one


class Broker(NamedTuple):
    """Where a broker is."""

    host: str
    port: int
    has_tls: bool

    def __str__(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{'mqtts' if self.has_tls else 'mqtt'}://{host}:{self.port}"

    @property
    def is_loopback(self) -> bool:
        """Whether it can only be this machine, whatever a name server says."""
        return is_loopback(self.host) or self.host == "localhost"


def is_loopback(host: str) -> bool:
    """Whether it is an address of this machine alone; a name is none."""
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return False


def broker(url: str) -> Broker:
    """The broker of `mqtts://host:port` or `mqtt://host:port`. Raises ConfigurationError."""
    wanted = "write for example mqtts://broker.example:8883, or mqtt://localhost:1883 without TLS"
    if "@" in url:  # and it is not shown: what is before that may be a password
        raise ConfigurationError("url: names a user", "name it in username and password_file")
    try:
        parts = urlsplit(url)
    except ValueError as error:
        raise ConfigurationError(f'url: "{url}" has a host in brackets that is no IPv6 address', wanted) from error
    if parts.scheme not in PORTS:
        raise ConfigurationError(f'url: "{url}" begins with neither mqtts:// nor mqtt://', wanted)
    if not parts.hostname or any(not "!" <= letter <= "~" for letter in url):
        raise ConfigurationError(f'url: "{url}" names no host', wanted)
    if parts.path.strip("/") or parts.query or parts.fragment:
        raise ConfigurationError(f'url: "{url}" goes on after the port', wanted)
    return Broker(parts.hostname, _port(parts) or PORTS[parts.scheme], parts.scheme == "mqtts")


def _port(parts: SplitResult) -> int | None:
    """None where there is none: the default is meant."""
    try:
        port = parts.port
    except ValueError:
        port = 0
    if port == 0:
        raise ConfigurationError(f'url: "{parts.geturl()}" has a port that is none', "a port is 1 to 65535")
    return port
