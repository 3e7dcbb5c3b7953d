"""Servers and clients of a certificate authority of the tests: good and bad ones."""

import subprocess
from collections.abc import Sequence

from firmware.lab import certificates
from firmware.lab.certificates import Pair

LOOPBACK = ("DNS:localhost", "IP:127.0.0.1")


class Authority(certificates.Authority):
    """Another authority's `certificate` is what makes this one unknown."""

    def server(self, hosts: Sequence[str] = LOOPBACK, is_expired: bool = False) -> Pair:
        """hosts: its alternative names. The wrong host is ("DNS:other.example",)."""
        extensions = f"extendedKeyUsage=serverAuth\nsubjectAltName={','.join(hosts)}\n"
        return self.issue("server", extensions, *_validity(is_expired))

    def client(self, name: str, is_expired: bool = False) -> Pair:
        """name: its common name."""
        return self.issue(name, "extendedKeyUsage=clientAuth\n", *_validity(is_expired))


def _validity(is_expired: bool) -> tuple[Sequence[str], ...]:
    """Options of an expired certificate: OpenSSL before 3.4 has no dates, later ones refuse a negative number of days."""
    if not is_expired:
        return ()
    known = subprocess.run(["openssl", "x509", "-help"], capture_output=True, text=True, check=True).stderr
    if "-not_after" in known:
        return (("-not_before", "20200101000000Z", "-not_after", "20200102000000Z"),)
    return (("-days", "-1"),)
