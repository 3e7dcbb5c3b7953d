"""Servers and clients of a certificate authority of the tests: good and bad ones."""

from collections.abc import Sequence

from firmware.lab import certificates
from firmware.lab.certificates import DAYS, Pair

LOOPBACK = ("DNS:localhost", "IP:127.0.0.1")
EXPIRED = -1  # days


class Authority(certificates.Authority):
    """Another authority's `certificate` is what makes this one unknown."""

    def server(self, hosts: Sequence[str] = LOOPBACK, days: int = DAYS) -> Pair:
        """hosts: its alternative names. The wrong host is ("DNS:other.example",), the expired one days=EXPIRED."""
        return self.issue("server", f"extendedKeyUsage=serverAuth\nsubjectAltName={','.join(hosts)}\n", days)

    def client(self, name: str, days: int = DAYS) -> Pair:
        """name: its common name."""
        return self.issue(name, "extendedKeyUsage=clientAuth\n", days)
