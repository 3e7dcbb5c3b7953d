"""Address of a broker, parsed from its URL."""

from ipaddress import IPv4Address, IPv6Address, ip_address
from typing import NamedTuple
from urllib.parse import SplitResult, urlsplit

from board.runtime.errors import ConfigurationError

PORTS = {"mqtt": 1883, "mqtts": 8883}  # default port by scheme, as registered at IANA
LOCAL_NAMES = ("ip6-localhost", "ip6-loopback")  # /etc/hosts of Debian; DNS may know others by them, unlike localhost


class Broker(NamedTuple):
    """Address of a broker: host name or IP address, port, and use of TLS."""

    host: str
    port: int
    has_tls: bool

    def __str__(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{'mqtts' if self.has_tls else 'mqtt'}://{host}:{self.port}"

    @property
    def place(self) -> str:
        """Host and port; equal for all names and addresses of this machine, and all forms of an IP address.

        Other names are not resolved: DNS may be unavailable when the station starts.
        """
        if self.is_loopback or self.host in LOCAL_NAMES:
            return f"localhost:{self.port}"
        return f"{_address(self.host) or self.host.rstrip('.')}:{self.port}"

    @property
    def is_loopback(self) -> bool:
        """True if the broker is certainly on this machine: by its IP address, or the name localhost."""
        return is_loopback(self.host) or self.host == "localhost"


def is_loopback(host: str) -> bool:
    """Return True for an IP address of which a connection stays on this machine; False for any name.

    These are loopback addresses, also in IPv6 form (::ffff:127.0.0.1), and the unspecified 0.0.0.0 and ::.
    """
    address = _address(host)
    return address is not None and (address.is_loopback or address.is_unspecified)


def _address(host: str) -> IPv4Address | IPv6Address | None:
    """Return an IP address, that of IPv4 if IPv6 maps it (::ffff:10.0.0.1); None for a name."""
    try:
        address = ip_address(host)
    except ValueError:
        return None
    return getattr(address, "ipv4_mapped", None) or address


def broker(url: str) -> Broker:
    """Parse `mqtts://host:port` or `mqtt://host:port`; without a port, the scheme's default is used.

    Raises ConfigurationError for another scheme, a user, a missing host, an invalid port, or text after the port.
    """
    wanted = "write for example mqtts://broker.example:8883, or mqtt://localhost:1883 without TLS"
    if "@" in url:  # the message does not show the URL, because it may contain a password
        raise ConfigurationError("url: names a user", "name it in username and password_file")
    try:
        parts = urlsplit(url)
    except ValueError as error:
        raise ConfigurationError(f'url: invalid IPv6 address in brackets: "{url}"', wanted) from error
    if parts.scheme not in PORTS:
        raise ConfigurationError(f'url: neither mqtts:// nor mqtt://: "{url}"', wanted)
    if not parts.hostname or any(not "!" <= letter <= "~" for letter in url):
        raise ConfigurationError(f'url: no host: "{url}"', wanted)
    if parts.path.strip("/") or parts.query or parts.fragment:
        raise ConfigurationError(f'url: text after the port: "{url}"', wanted)
    return Broker(parts.hostname, _port(parts) or PORTS[parts.scheme], parts.scheme == "mqtts")


def _port(parts: SplitResult) -> int | None:
    """Return the port of a URL; None without one. Raises ConfigurationError for an invalid port."""
    try:
        port = parts.port
    except ValueError:
        port = 0
    if port == 0:
        raise ConfigurationError(f'url: invalid port: "{parts.geturl()}"', "a port is 1 to 65535")
    return port
