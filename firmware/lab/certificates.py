"""Certificates for an afternoon, made by the program openssl: an authority, a broker, its clients."""

import subprocess
from pathlib import Path
from typing import NamedTuple

from board.errors import StationError

CURVE = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes")
DAYS = "2"


class Identity(NamedTuple):
    """What one end shows: PEM files, the key for its owner alone."""

    certificate: Path
    key: Path


class Authority:
    """Signs in a folder. Raises StationError where openssl is missing or fails."""

    def __init__(self, folder: Path) -> None:
        self.certificate = folder / "authority.pem"
        self._folder = folder
        self._key = folder / "authority.key"
        files = ("-keyout", str(self._key), "-out", str(self.certificate))
        _openssl("req", "-x509", *CURVE, "-subj", "/CN=captain lab", "-days", DAYS, *files)

    def issue(self, name: str, extensions: str) -> Identity:
        """name: its common name. extensions: lines of x509v3_config(5)."""
        stem = self._folder / name
        identity = Identity(stem.with_suffix(".pem"), stem.with_suffix(".key"))
        request, wanted = stem.with_suffix(".csr"), stem.with_suffix(".ext")
        wanted.write_text(extensions)
        _openssl("req", "-new", *CURVE, "-subj", f"/CN={name}", "-keyout", str(identity.key), "-out", str(request))
        signer = ("-CA", str(self.certificate), "-CAkey", str(self._key), "-CAcreateserial", "-days", DAYS)
        files = ("-in", str(request), "-extfile", str(wanted), "-out", str(identity.certificate))
        _openssl("x509", "-req", *signer, *files)
        identity.key.chmod(0o600)
        return identity


def _openssl(*arguments: str) -> None:
    try:
        subprocess.run(["openssl", *arguments], check=True, capture_output=True, text=True)
    except FileNotFoundError as error:
        raise StationError("the program openssl is missing", "install the package openssl") from error
    except subprocess.CalledProcessError as error:
        raise StationError(f"openssl {arguments[0]}: {error.stderr.strip()}") from error
