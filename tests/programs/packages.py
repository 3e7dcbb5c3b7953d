"""make deb-test: the Debian packages in new roots: installed offline, run as their unit says, upgraded, purged."""

import argparse
import contextlib
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from image import own_files
from image.errors import ImageError
from image.packages import native_architecture
from image.program import box, deb, developer
from image.program.programs import PROCESSORS
from image.project import version
from image.tool import run
from tests.programs import forms, parts, setup
from tests.programs.debian import APT, PROJECT, SUITES, Debian
from tests.programs.wheels import CAM
from tests.proof.image.rows import Row

MADE = PROJECT / "build/deb"
RESULTS = PROJECT / "build/deb-test/results.json"
NAMES = ("captain", box.NAME, developer.NAME)
PURGE = f"{APT} purge {' '.join(NAMES)}"
DECLARED = ["passwd", "procps", "udev", "systemd", "chrony"]
# By the control socket, which the group may use; the report port is open to all users.
STATUS = ("captain", "status", "--control", "/run/captain/captain-5555.sock")
MOST_S = 120.0  # until a heartbeat arrives; in emulation the station starts in 20 s
# Paths, and contents of all files in etc, of what packages may change. dpkg's and apt's own records stay.
STATE = r"""
find / -xdev -path /proc -prune -o -path /dev -prune -o -path /mnt -prune -o -path /run -prune -o -path /var/lib/dpkg -prune -o \
    -path /var/cache -prune -o -path /var/lib/apt -prune -o -path /var/log -prune -o -path '/etc/*-' -prune -o -print
find /etc -type f ! -path '/etc/*-' -exec md5sum {} +
"""
_HEARD = """
import sys, zmq
heard = zmq.Context().socket(zmq.SUB)
heard.connect("tcp://127.0.0.1:5556")
heard.subscribe("hb.")
heard.poll(int(sys.argv[1])) and print(heard.recv_multipart()[0].decode())
"""


def main() -> int:
    parser = argparse.ArgumentParser(prog="make deb-test", description=__doc__)
    parser.add_argument("--suites", metavar="SUITE", nargs="+", choices=SUITES, default=list(SUITES))
    parser.add_argument("--arch", default=native_architecture(), help="of the package; default: this machine's")
    parser.add_argument(
        "--made", metavar="DIR", type=Path, default=MADE, help="the packages' folder; default: build/deb"
    )
    arguments = parser.parse_args()
    packages = [arguments.made / name for name in names(arguments.arch)]
    for path in packages:
        if not path.exists():
            print(f"deb-test: {path}: is missing; make deb builds it", file=sys.stderr)
            return 2
    each = (
        (f"{arguments.arch}, {SUITES[suite]}", _rows(suite, arguments.arch, packages)) for suite in arguments.suites
    )
    return parts.show(each, RESULTS)


def names(architecture: str) -> tuple[str, str, str]:
    """Names of the files of NAMES."""
    station, boxed, library = NAMES
    own = f"{version()}_{architecture}.deb"
    return f"{station}_{own}", f"{boxed}_{version()}_all.deb", f"{library}_{own}"


def _rows(suite: str, architecture: str, packages: list[Path]) -> Iterator[Row]:
    with tempfile.TemporaryDirectory(prefix="captain-") as name:
        folder = Path(name)
        yield forms.floor_row("C library", forms.unpack_package(packages[0], folder / "unpacked"))
        program = compiled(packages[2], architecture, folder)
        yield from _in_debian(Debian(suite, architecture, DECLARED, folder), packages, program, folder)


def compiled(package: Path, architecture: str, folder: Path) -> Path:
    """Compile the example of captain-dev by this machine's compiler for a processor, with the unpacked package alone."""
    triple = next(each.triple for each in PROCESSORS if each.debian == architecture)
    unpacked = folder / "developer"
    run(["dpkg-deb", "--extract", package, unpacked])
    described = {"PKG_CONFIG_LIBDIR": str(unpacked / f"usr/lib/{triple}/pkgconfig")}
    flags = run(["pkg-config", "--cflags", "--libs", "captain_messages"], environment=described).split()
    example = unpacked / f"usr/share/doc/{developer.NAME}/example/tree.c"
    run([f"{triple}-gcc", example, "-o", folder / "tree", *flags])
    return folder / "tree"


def _in_debian(debian: Debian, packages: list[Path], program: Path, folder: Path) -> Iterator[Row]:
    yield _row("Debian's own packages", debian.run("sh", "-c", f"{APT} update && {APT} install {' '.join(DECLARED)}"))
    setup.lay_out(debian)
    before = debian.run("sh", "-c", STATE).stdout
    inside = " ".join(debian.copy(package) for package in packages)
    yield _row("apt installs them, offline", debian.run("sh", "-c", f"{APT} install {inside}"))
    yield _quiet("dpkg --verify", debian.run("dpkg", "--verify", *NAMES))
    ended = debian.run(debian.copy(program), "cam-1.4.1", CAM)
    yield _row("program linked with captain-dev", ended, "decodes", "2602961571" in ended.stdout)
    unit = "/usr/lib/systemd/system/captain.service"
    yield _quiet("systemd-analyze verify", debian.run("systemd-analyze", "verify", unit))
    if debian.run("udevadm", "verify", "--help").returncode == 0:  # not Debian 12's
        verify = "udevadm verify /usr/lib/udev/rules.d/7*-captain*.rules"
        yield _row("udevadm verify", debian.run("sh", "-c", verify))
    ended = debian.run("chronyd", "-p", "-f", "/etc/chrony/chrony.conf")
    is_source = "refclock SOCK /run/chrony.captain.sock" in ended.stdout
    yield _row("chronyd reads its source", ended, "with the refclock" if is_source else ended.stdout, is_source)
    yield from _running(debian)
    ended = debian.run("captain", "doctor", "--config", "/etc/captain/captain.toml", "--board", "none")
    yield _row("doctor", ended, ended.stdout.strip().splitlines()[-1], "problems: 0," in ended.stdout)
    yield from setup.rows(debian)
    own = debian.root / "etc/captain/captain.toml"
    own.write_text(f"{own.read_text()}# mine\n")
    newer = debian.copy(_later(packages[0], folder))
    yield _row("upgrade", debian.run("sh", "-c", f"{APT} install {newer}"))
    yield Row("upgrade keeps the owner's file", own.read_text().splitlines()[-1], "# mine", "# mine" in own.read_text())
    yield _row("purge", debian.run("sh", "-c", PURGE))
    left = difference(before, debian.run("sh", "-c", STATE).stdout)
    yield setup.reverted(debian)
    yield Row("purge leaves", ", ".join(left[:3]) or "nothing", "nothing", not left)
    yield from _of_others(debian, f"{APT} install {inside}", PURGE)


def _of_others(debian: Debian, install: str, purge: str) -> Iterator[Row]:
    """Purge and install beside what the owner has made: a group captain, a member of a group of captain-box, a login called captain."""
    debian.run("sh", "-c", "groupadd --system captain && useradd --no-user-group member")
    ended = debian.run("sh", "-c", f"{install} && usermod --append --groups gpio member && {purge}")
    kept = debian.run("getent", "group", "captain", "gpio").stdout.split()
    is_kept = [row.partition(":")[0] for row in kept] == ["captain", "gpio"] and kept[1].endswith(":member")
    yield _row("purge keeps groups of others", ended, " ".join(kept), is_kept)
    debian.run("sh", "-c", "userdel member; groupdel gpio; groupdel captain; useradd --uid 1000 captain")
    ended = debian.run("sh", "-c", install)
    is_refused = ended.returncode != 0 and "captain: user captain has uid 1000" in ended.stdout
    is_kept = debian.run("getent", "passwd", "captain").returncode == 0
    seen = "refused" if is_refused else ended.stdout.strip()[-100:]
    yield Row("install with a login captain", seen, "refused", is_refused and is_kept)


def difference(before: str, after: str) -> list[str]:
    """Lines that only one of two states has."""
    return sorted(set(before.splitlines()) ^ set(after.splitlines()))


def _running(debian: Debian) -> Iterator[Row]:
    """The station as its unit starts it, by hand: no systemd runs in a root."""
    debian.run("useradd", "--groups", "captain", "member")
    debian.run("useradd", "stranger")
    debian.run("install", "-d", "-o", "captain", "-g", "captain", "-m", "0750", "/run/captain", "/var/lib/captain")
    station = debian.start(*_as("captain"), "sh", "-c", f"export RUNTIME_DIRECTORY=/run/captain; exec {command()}")
    beside = ["nsenter", f"--target={station.pid}", "--net"]
    try:
        _wait_for_network(station)
        heard = _run([*beside, str(PROJECT / ".venv/bin/python"), "-c", _HEARD, str(int(MOST_S * 1000))])
        yield _row("heartbeat, from outside", heard, is_ok=heard.stdout.startswith("hb."))
        entered = [*beside, "--mount", "--root", "env", "PATH=/usr/bin:/bin"]
        ended = _run([*entered, *_as("member"), *STATUS])
        yield _row("status, as a member of the group", ended, f"{len(ended.stdout.splitlines())} lines")
        ended = _run([*entered, *_as("stranger"), *STATUS])
        said = (ended.stdout + ended.stderr).strip()
        is_refused = ended.returncode != 0 and "permission denied" in said.lower()
        yield Row("status, as another user", said[:100], "permission denied", is_refused)
    finally:
        station.terminate()
        with contextlib.suppress(subprocess.TimeoutExpired):
            said = station.communicate(timeout=30)[0]
            print(*said.strip().splitlines()[-5:], sep="\n", flush=True)
    debian.run("sh", "-c", "userdel member; userdel stranger; rm -rf /run/captain")


def _wait_for_network(station: "subprocess.Popen[str]") -> None:
    """Wait until unshare has made a network for a process. Raises ImageError after 10 s."""
    own, ends = Path("/proc/self/ns/net").readlink(), time.monotonic() + 10
    while Path(f"/proc/{station.pid}/ns/net").readlink() == own:
        if time.monotonic() > ends:
            raise ImageError("unshare has made no network within 10 s")
        time.sleep(0.01)


def command() -> str:
    """ExecStart of the package's unit, with the values of /etc/default/captain."""
    found = re.search("(?m)^ExecStart=(.*)$", own_files.read(deb.UNIT, own_files.PACKAGE))
    if not found:
        raise ImageError(f"{deb.UNIT}: has no ExecStart")
    return found[1].replace("${CAPTAIN_BOARD}", "none").replace("$CAPTAIN_OPTIONS", "")


def _as(user: str) -> list[str]:
    return ["setpriv", f"--reuid={user}", f"--regid={user}", "--init-groups"]


def _run(words: list[str]) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        words, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False, timeout=2 * MOST_S
    )


def _later(package: Path, folder: Path) -> Path:
    """The same package with a higher version."""
    tree, target = folder / "later", folder / "captain_later.deb"
    run(["dpkg-deb", "--raw-extract", package, tree])
    control = tree / "DEBIAN/control"
    control.write_text(control.read_text().replace(f"Version: {version()}", f"Version: {version()}+1"))
    run(["dpkg-deb", "--root-owner-group", "-Zgzip", "-z1", "--build", tree, target])
    return target


def _quiet(what: str, ended: "subprocess.CompletedProcess[str]") -> Row:
    return _row(what, ended, ended.stdout.strip() or "no difference", not ended.stdout.strip())


def _row(what: str, ended: "subprocess.CompletedProcess[str]", seen: str = "", is_ok: bool = True) -> Row:
    is_ok = is_ok and ended.returncode == 0
    if not is_ok:
        print(ended.stdout, ended.stderr or "", flush=True)
    return Row(what, seen or (ended.stdout.strip().splitlines() or ["done"])[-1], "exit code 0", is_ok)


if __name__ == "__main__":
    sys.exit(main())
