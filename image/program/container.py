"""OCI image of the station: packages laid out without scripts, and packed by umoci, without a daemon."""

import os
import shutil
import tempfile
from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path

from image.program import deb, frozen
from image.tool import run

FILES = Path(__file__).parents[1] / "oci"
TAG = "captain"  # podman load calls the image localhost/captain
# Debian packages beside the station's own: the names of the release, authorities of TLS, libraries of the program's
# loader, and the list of leap seconds.
PACKAGES = ("base-files", "ca-certificates", "libc6", "tzdata", "zlib1g")
USER = 10001  # above the logins of a host; the image has no other user
PORTS = range(5555, 5560)
CONFIGURATION = "/etc/captain/captain.toml"
STATE, RUN = "/var/lib/captain", "/run/captain"
LEFT_OUT = (frozen.WORK, "usr/share/man", "usr/share/lintian")

_ACCOUNTS = {
    "etc/passwd": f"root:x:0:0:root:/root:/usr/sbin/nologin\ncaptain:x:{USER}:{USER}::{STATE}:/usr/sbin/nologin\n",
    "etc/group": f"root:x:0:\ncaptain:x:{USER}:\n",
}
_AUTHORITIES = "etc/ssl/certs/ca-certificates.crt"


def make(packages: Iterable[Path], architecture: str, epoch: int, target: Path) -> None:
    """Make the image as an OCI archive.

    packages      Debian packages of the root: those of PACKAGES, and captain.
    architecture  of the image, by the name that Debian and OCI have: arm64.
    epoch         date of all files and of the image, Unix seconds.

    The files need this machine's root: those of the station's user get its number. Raises ImageError if a tool fails.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        root, layout = folder / "root", folder / "layout"
        frozen.lay_out(packages, root)
        complete(root, epoch)
        _pack(root, layout, architecture, datetime.fromtimestamp(epoch, UTC).strftime("%Y-%m-%dT%H:%M:%SZ"))
        order = ["--mode=u=rwX,go=rX", "--sort=name", f"--mtime=@{epoch}", "--owner=0", "--group=0", "--numeric-owner"]
        run(["tar", "--create", "--file", target, *order, "--directory", layout, "oci-layout", "index.json", "blobs"])


def complete(root: Path, epoch: int) -> None:
    """Do what the packages' scripts would do for a station. Raises OSError without the rights of root."""
    for place in LEFT_OUT:
        shutil.rmtree(root / place, ignore_errors=True)
    for account, text in _ACCOUNTS.items():
        deb.write(root / account, text.encode())
    deb.write(root / CONFIGURATION.lstrip("/"), (FILES / "captain.toml").read_bytes())
    authorities = sorted((root / "usr/share/ca-certificates").rglob("*.crt"))
    deb.write(root / _AUTHORITIES, b"".join(path.read_bytes() for path in authorities))
    (root / "usr/lib/ssl").mkdir(parents=True, exist_ok=True)
    (root / "usr/lib/ssl/cert.pem").symlink_to(f"/{_AUTHORITIES}")  # default of the station's OpenSSL
    shutil.rmtree(root / "usr/share/ca-certificates")
    for folder in (STATE, RUN):
        (root / folder.lstrip("/")).mkdir(parents=True)
        os.chown(root / folder.lstrip("/"), USER, USER)
    (root / "tmp").chmod(0o1777)
    for path in [root, *root.rglob("*")]:
        os.utime(path, (epoch, epoch), follow_symlinks=False)


def _pack(root: Path, layout: Path, architecture: str, date: str) -> None:
    image = ["--image", f"{layout}:{TAG}"]
    run(["umoci", "init", "--layout", layout])
    run(["umoci", "new", *image])
    run(["umoci", "insert", *image, "--history.created", date, root, "/"])
    ports = [word for port in PORTS for word in ("--config.exposedports", f"{port}/tcp")]
    start = ["--config.entrypoint", "captain", *(f"--config.cmd={word}" for word in ("run", "--config", CONFIGURATION))]
    places = ["--config.env", "PATH=/usr/bin", "--config.env", f"STATE_DIRECTORY={STATE}", "--config.volume", STATE]
    dates = ["--created", date, "--history.created", date]
    about = ["--architecture", architecture, "--config.user", f"{USER}:{USER}", "--config.stopsignal", "SIGTERM"]
    run(["umoci", "config", *image, *about, *ports, *start, *places, *dates])
    run(["umoci", "gc", "--layout", layout])  # blobs of the steps before
