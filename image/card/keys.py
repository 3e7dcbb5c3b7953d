"""Update keys: a development key of this build, or a release key."""

import os
import secrets
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

from image.errors import ImageError
from image.tool import run

DEVELOPMENT = "development"
RELEASE = "release"
KEY, CERTIFICATE, KEYRING = "CAPTAIN_RELEASE_KEY", "CAPTAIN_RELEASE_CERT", "CAPTAIN_RELEASE_KEYRING"
PKCS11 = "pkcs11:"
# The date for a certificate without a well-defined expiration date: RFC 5280, 4.1.2.5. A box in a cellar needs this.
NEVER = "99991231235959Z"

# Before OpenSSL 3.4, x509 cannot set the begin of a certificate's validity; `openssl ca` can.
_AUTHORITY = """\
[ca]
default_ca = own
[own]
database = {folder}/index
serial = {folder}/serial
new_certs_dir = {folder}
default_md = sha256
policy = any
x509_extensions = signer
[any]
commonName = supplied
organizationName = supplied
[signer]
basicConstraints = critical,CA:true
keyUsage = critical,digitalSignature,keyCertSign
subjectKeyIdentifier = hash
[req]
distinguished_name = name
[name]
"""


class Keys(NamedTuple):
    """Keys of one build.

    kind         DEVELOPMENT or RELEASE.
    key          path, or PKCS#11 URI for a key in hardware, which never leaves it.
    certificate  certificate of the key.
    keyring      certificate that boxes trust: the key's own, or that of its authority.
    """

    kind: str
    key: str
    certificate: Path
    keyring: Path


def chosen(folder: Path, epoch: int, environment: Mapping[str, str] = os.environ) -> Keys:
    """Return the release key if the environment names one, else the development key.

    folder  keeps the development key for further builds.
    epoch   date of the build in Unix seconds, from which a new certificate is valid.

    Raises ImageError if the environment names only a part of a release key, or an absent file.
    """
    return _of_release(environment) or development(folder, epoch)


def kept(folder: Path, environment: Mapping[str, str] = os.environ) -> Keys:
    """Return the keys of a card that was built; make none. Raises ImageError if they are absent."""
    found = _of_release(environment) or _of_development(folder)
    if not found.certificate.exists():
        raise ImageError(f"{found.certificate}: missing", "run make image, which makes key, certificate and card")
    return found


def _of_release(environment: Mapping[str, str]) -> Keys | None:
    key, certificate = environment.get(KEY, ""), environment.get(CERTIFICATE, "")
    if not key and not certificate:
        if environment.get(KEYRING):
            raise ImageError(f"{KEYRING} is set, but no key to sign with", f"set {KEY} and {CERTIFICATE} as well")
        return None
    for name, value in ((KEY, key), (CERTIFICATE, certificate)):
        if not value:
            raise ImageError(f"{name} is not set", "a release has a key and its certificate: set both, or neither")
    keyring = environment.get(KEYRING, "") or certificate
    files = [certificate, keyring, *([] if key.startswith(PKCS11) else [key])]
    for path in files:
        if not Path(path).is_file():
            raise ImageError(f"{path}: not found", f"{KEY}, {CERTIFICATE} and {KEYRING} are paths")
    return Keys(RELEASE, key, Path(certificate), Path(keyring))


def development(folder: Path, epoch: int) -> Keys:
    """Return the key of this build folder; make it if absent. Raises ImageError if openssl fails."""
    found = _of_development(folder)
    if not (Path(found.key).exists() and found.certificate.exists()):
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        make(Path(found.key), found.certificate, "development", epoch)
    return found


def _of_development(folder: Path) -> Keys:
    certificate = folder / "development.cert.pem"
    return Keys(DEVELOPMENT, str(folder / "development.key.pem"), certificate, certificate)


def make(key: Path, certificate: Path, name: str, epoch: int) -> None:
    """Make a key with a self-signed certificate. A random number in the name distinguishes keys of build folders."""
    folder = key.parent
    begins = datetime.fromtimestamp(epoch, UTC).strftime("%Y%m%d%H%M%SZ")
    settings, request = folder / "authority", folder / "request"
    settings.write_text(_AUTHORITY.format(folder=folder))
    (folder / "index").write_text("")
    (folder / "serial").write_text(f"{secrets.token_hex(8)}\n")
    subject = f"/O=captain/CN=captain {name} {secrets.token_hex(4)}"
    run(["openssl", "genpkey", "-algorithm", "EC", "-pkeyopt", "ec_paramgen_curve:P-256", "-out", key])
    key.chmod(0o600)
    run(["openssl", "req", "-new", "-config", settings, "-key", key, "-subj", subject, "-out", request])
    dates = ["-startdate", begins, "-enddate", NEVER]
    run(["openssl", "ca", "-batch", "-notext", "-selfsign", "-config", settings, "-keyfile", key, *dates,
         "-in", request, "-out", certificate])  # fmt: skip
    for path in folder.iterdir():
        if path not in (key, certificate) and (path in (settings, request) or path.name[:5] in ("index", "seria")):
            path.unlink()
    for path in folder.glob("[0-9A-F]*.pem"):  # copy of the certificate, named by its serial number
        path.unlink()


def subject(certificate: Path) -> str:
    """Return the subject of a certificate in readable form."""
    said = run(["openssl", "x509", "-in", certificate, "-noout", "-subject", "-nameopt", "RFC2253"])
    return said.strip().removeprefix("subject=")


def secret(keys: Keys) -> bytes:
    """Return octets that show a copy of the key: the longest line of its file; empty for a key in hardware."""
    if keys.key.startswith(PKCS11):
        return b""
    lines = [line for line in Path(keys.key).read_bytes().splitlines() if line and not line.startswith(b"-")]
    return max(lines, key=len, default=b"")
