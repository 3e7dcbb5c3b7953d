"""Repository for apt: apt-ftparchive writes its lists, gpg signs them."""

import re
import shutil
from collections.abc import Sequence
from datetime import UTC, datetime
from email.utils import format_datetime
from pathlib import Path

from image.errors import ImageError
from image.program import deb
from image.tool import run

SUITE, COMPONENT = "stable", "main"
SIGNING = "is it there (gpg --list-secret-keys), not expired, and its passphrase known (export GPG_TTY=$(tty))?"
KEY = "captain.asc"  # public key beside the lists, for signed-by of apt's sources


def check(key: str) -> None:
    """Sign a text, before the long steps of a release. Raises ImageError if gpg cannot sign."""
    if not re.fullmatch("[0-9A-Fa-f]{40}", key):
        raise ImageError(
            f"KEY: {key[:60]!r} is not a fingerprint", "gpg --list-secret-keys prints fingerprints of 40 digits"
        )
    try:
        run(["gpg", "--batch", "--local-user", key, "--clear-sign"], given="captain\n")
    except ImageError as error:
        raise ImageError(f"KEY: {key}: gpg of root cannot sign with it: {error.message}", SIGNING) from error


def make(packages: Sequence[Path], architectures: Sequence[str], epoch: int, to: Path, key: str = "") -> None:
    """Make the repository in place of an earlier one; without a signature, equal packages give equal files.

    architectures  Debian's names of the processors.
    epoch          date of the lists, Unix seconds.
    to             folder of the repository.
    key            fingerprint of the key that signs; empty: no signature.

    Raises ImageError if a tool fails.
    """
    shutil.rmtree(to, ignore_errors=True)
    (to / "pool").mkdir(parents=True)
    for package in packages:
        shutil.copy(package, to / "pool")
    lists = to / "dists" / SUITE
    for architecture in architectures:
        # Its own and those for all processors.
        found = run(["apt-ftparchive", "--arch", architecture, "packages", "pool"], folder=to)
        deb.write(lists / COMPONENT / f"binary-{architecture}/Packages", found.encode())
    fields = {
        "Date": format_datetime(datetime.fromtimestamp(epoch, UTC)),
        "Origin": "captain",
        "Label": "captain",
        "Suite": SUITE,
        "Codename": SUITE,
        "Architectures": " ".join(architectures),
        "Components": COMPONENT,
    }
    words = [word for name, text in fields.items() for word in ("-o", f"APT::FTPArchive::Release::{name}={text}")]
    (lists / "Release").write_text(run(["apt-ftparchive", *words, "release", lists]))
    if key:
        _sign(lists, key, to / KEY)


def _sign(lists: Path, key: str, public: Path) -> None:
    gpg = ["gpg", "--batch", "--armor", "--local-user", key]
    run([*gpg, "--output", lists / "InRelease", "--clear-sign", lists / "Release"])
    run([*gpg, "--output", lists / "Release.gpg", "--detach-sign", lists / "Release"])
    run([*gpg, "--output", public, "--export", key])
