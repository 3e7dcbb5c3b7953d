"""Short-lived certificates by openssl: for an authority, a broker and its clients."""

import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from board.runtime.errors import StationError

CURVE = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes")
DAYS = 2
USAGE = "keyUsage=critical,keyCertSign,cRLSign"  # strict verifiers such as Python 3.13 require it (RFC 5280, 4.2.1.3)


class Pair(NamedTuple):
    """Certificate and key of one end as PEM files; only their owner may read the key."""

    certificate: Path
    key: Path


class Authority:
    """Certificate authority whose files are in a folder under its own name.

    Raises StationError if openssl is missing or fails.
    """

    def __init__(self, folder: Path, name: str = "authority") -> None:
        self.certificate = folder / f"{name}.pem"
        self._folder = folder
        self._key = folder / f"{name}.key"
        self._issued = 0
        files = ("-keyout", str(self._key), "-out", str(self.certificate))
        subject = ("-subj", f"/CN=captain lab {name}", "-days", str(DAYS), "-addext", USAGE)
        _openssl("req", "-x509", *CURVE, *subject, *files)
        self._key.chmod(0o600)

    def issue(self, name: str, extensions: str, validity: Sequence[str] = ("-days", str(DAYS))) -> Pair:
        """Issue a certificate with its key.

        name        common name of the certificate.
        extensions  lines of x509v3_config(5).
        validity    options of openssl-x509(1).

        Raises StationError if openssl is missing or refuses.
        """
        self._issued += 1
        stem = f"{self.certificate.stem}-{self._issued}-{name}"
        certificate, key, request, wanted = (self._folder / f"{stem}.{end}" for end in ("pem", "key", "csr", "ext"))
        wanted.write_text(extensions)
        _openssl("req", "-new", *CURVE, "-subj", f"/CN={name}", "-keyout", str(key), "-out", str(request))
        signer = ("-CA", str(self.certificate), "-CAkey", str(self._key), "-set_serial", str(self._issued))
        files = ("-in", str(request), "-extfile", str(wanted), "-out", str(certificate))
        _openssl("x509", "-req", *signer, *validity, *files)
        key.chmod(0o600)
        return Pair(certificate, key)


def _openssl(*arguments: str) -> None:
    try:
        subprocess.run(["openssl", *arguments], check=True, capture_output=True, text=True)
    except FileNotFoundError as error:
        raise StationError("the program openssl is missing", "install the package openssl") from error
    except subprocess.CalledProcessError as error:
        raise StationError(f"openssl {arguments[0]}: {error.stderr.strip()}") from error
