"""New Debian roots, made of packages that apt has compared with its signed lists, and entered without a network."""

import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

from image import description
from image.packages import Archive, write_index
from image.tool import run

PROJECT = Path(__file__).resolve().parents[2]
# Their own copy of apt's lists and packages, kept for the next run.
ARCHIVES = PROJECT / "build/programs-test/archives"
SUITES = {"bookworm": "Debian 12", "trixie": "Debian 13"}
APT = "apt-get -qq -y -o APT::Sandbox::User=root --no-install-recommends"  # what is recommended is not declared
MOST_S = 900  # of one program in an emulated root: apt took 60 s beside other work

# A network with nothing but loopback: ports of this machine's stations are not there. All of it ends with the program.
_ENTER = """\
root=$1 archive=$2; shift 2
ip link set lo up && mount --rbind /dev "$root/dev" && mount -t proc proc "$root/proc" &&
mkdir -p "$root$archive" && mount --bind "$archive" "$root$archive" && exec chroot "$root" /usr/bin/env -i \
    PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LC_ALL=C.UTF-8 DEBIAN_FRONTEND=noninteractive "$@"
"""


class Debian:
    """A root of a release for a processor: essential packages and apt, which is less than a minbase one has.

    declared  names of packages that apt in it finds as well, with what they depend on.
    """

    def __init__(self, suite: str, architecture: str, declared: list[str], folder: Path) -> None:
        base = description.read(PROJECT / "image/image.toml").base
        place = ARCHIVES / f"{suite}-{architecture}"
        archive = Archive(place, replace(base, suite=suite, beside=()), architecture)
        archive.update()
        self._files = place / "archives"
        write_index(self._files, archive.closed(["?essential", "apt", *declared]))
        self.root = folder / "root"
        source = f"deb [trusted=yes] copy:{self._files} ./"
        how = ["--variant=essential", "--include=apt", f"--architectures={architecture}", "--format=directory"]
        run(["mmdebstrap", "--quiet", *how, "", self.root, source])

    def copy(self, file: Path) -> str:
        """A file into the root; returns its path there."""
        shutil.copy(file, self.root / "mnt")
        return f"/mnt/{file.name}"

    def run(self, *words: str) -> "subprocess.CompletedProcess[str]":
        """A program in it, with its output and errors in one."""
        return subprocess.run(
            self._entered(words),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            check=False,
            timeout=MOST_S,
        )

    def start(self, *words: str) -> "subprocess.Popen[str]":
        """Start a program in it; its errors go to the output. The process is the program itself, for nsenter."""
        return subprocess.Popen(
            self._entered(words),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
        )

    def _entered(self, words: tuple[str, ...]) -> list[str]:
        return ["unshare", "--mount", "--net", "sh", "-c", _ENTER, "sh", str(self.root), str(self._files), *words]
