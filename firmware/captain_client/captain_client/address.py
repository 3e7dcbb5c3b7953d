"""Address of a station: a host and its four ports."""

from typing import NamedTuple

from captain_client.arguments import check_text

HIGHEST = 0xFFFF
FIRST = 5555


class Address(NamedTuple):
    """Host and ports of a station: users' PUB, SUB and PUSH sockets, and reports."""

    host: str = "127.0.0.1"
    from_users: int = FIRST
    to_users: int = FIRST + 1
    pull: int = FIRST + 2
    report: int = FIRST + 3

    def url(self, port: int) -> str:
        """Return the ZeroMQ address of a port at this host; IPv6 addresses get brackets."""
        return f"tcp://[{self.host}]:{port}" if ":" in self.host else f"tcp://{self.host}:{port}"


def parse(text: str) -> Address:
    """Parse `HOST`, `HOST:PORT`, `:PORT` or `[V6]:PORT`. PORT is the first of the station's four ports.

    A missing host is 127.0.0.1, a missing port 5555. Raises ValueError for an invalid text.
    """
    check_text("address", text, 'such as "captain-7.local", "captain-7.local:5555" or ":5565"')
    scheme, separator, _ = text.partition("://")
    if separator:
        raise ValueError(f"{text!r}: invalid host and port; write HOST:PORT without {scheme}://")
    if text.isascii() and text.isdigit():
        raise ValueError(f"{text!r}: a port without a colon; write :{text}")
    host, port = _host_and_port(text)
    first = int(port) if port.isascii() and port.isdigit() and len(port) < 6 else 0
    if port and not 0 < first <= HIGHEST - 3:
        raise ValueError(f"{text!r}: invalid port; 1 to {HIGHEST - 3}, because three more ports follow it")
    first = first or FIRST
    return Address(host or "127.0.0.1", first, first + 1, first + 2, first + 3)


def _host_and_port(text: str) -> tuple[str, str]:
    if text.startswith("["):
        host, _, rest = text[1:].partition("]")
        return host, rest[1:] if rest.startswith(":") else rest
    if text.count(":") > 1:
        return text, ""
    host, _, port = text.partition(":")
    return host, port
