"""Certificates for an afternoon, made by the program openssl: an authority, a broker, its clients."""

import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from board.errors import StationError

CURVE = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes")
DAYS = 2
USAGE = "keyUsage=critical,keyCertSign,cRLSign"  # strict verifiers ask for it: Python 3.13 (RFC 5280, 4.2.1.3)


class Pair(NamedTuple):
    """What one end shows: PEM files, the key for its owner alone."""

    certificate: Path
    key: Path


class Authority:
    """Signs in a folder, in which its name is its own. Raises StationError where openssl is missing or fails."""

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
        """name: its common name. extensions: lines of x509v3_config(5). validity: options of openssl-x509(1)."""
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
