"""A certificate authority of the tests, by the program openssl: servers and clients, good and bad ones."""

import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

CURVE = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes")
LOOPBACK = ("DNS:localhost", "IP:127.0.0.1")
DAYS = 2
EXPIRED = -1  # days
SERVER, CLIENT = "serverAuth", "clientAuth"


class Identity(NamedTuple):
    """What one end of a TLS connection shows. Both are PEM files; the key's is for its owner alone."""

    certificate: Path
    key: Path


class Authority:
    """Signs certificates. Another authority's `certificate` is what makes this one unknown."""

    def __init__(self, folder: Path, name: str = "authority") -> None:
        self.certificate = folder / f"{name}.pem"
        self._folder = folder
        self._key = folder / f"{name}.key"
        self._issued = 0
        named = ("-subj", f"/CN={name} of the tests", "-days", str(DAYS))
        files = ("-keyout", str(self._key), "-out", str(self.certificate))
        _openssl("req", "-x509", *CURVE, *named, *files)
        self._key.chmod(0o600)

    def server(self, hosts: Sequence[str] = LOOPBACK, days: int = DAYS) -> Identity:
        """hosts: its alternative names. The wrong host is ("DNS:other.example",), the expired one days=EXPIRED."""
        return self._issue("server", SERVER, days, f"subjectAltName={','.join(hosts)}")

    def client(self, name: str, days: int = DAYS) -> Identity:
        """name: its common name."""
        return self._issue(name, CLIENT, days)

    def _issue(self, name: str, use: str, days: int, *extensions: str) -> Identity:
        self._issued += 1
        stem = self._folder / f"{self.certificate.stem}-{self._issued}-{name}"
        identity = Identity(stem.with_suffix(".pem"), stem.with_suffix(".key"))
        request, more = stem.with_suffix(".request"), stem.with_suffix(".extensions")
        more.write_text("\n".join((f"extendedKeyUsage={use}", *extensions)) + "\n")
        files = ("-keyout", str(identity.key), "-out", str(request))
        _openssl("req", "-new", *CURVE, "-subj", f"/CN={name}", *files)
        signer = ("-CA", str(self.certificate), "-CAkey", str(self._key), "-set_serial", str(self._issued))
        terms = ("-days", str(days), "-extfile", str(more))
        _openssl("x509", "-req", "-in", str(request), *signer, *terms, "-out", str(identity.certificate))
        identity.key.chmod(0o600)
        return identity


def _openssl(*arguments: str) -> None:
    done = subprocess.run(["openssl", *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"openssl {arguments[0]}: {done.stderr}"
