"""The root file system: Debian's userland by its own scripts, then what is ours, and nothing of where it was built."""

import re
import tarfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from image import accounts
from image.description import Description
from image.errors import ImageError
from image.kernel import Kernel
from image.packages import Package, write_index
from image.program import run
from image.tree import Tree

OVERLAY = Path(__file__).parent / "overlay"
PLACE = "usr/lib/captain"  # of the program
DOCUMENTS = "usr/share/doc/captain"
DPKG = "var/lib/dpkg"

# Times that scripts write into files, such as the day of an account: of no day.
EPOCH = "1735689600"  # 2025-01-01

# Not kept: what names the place of the build, what belongs to one box, what only a package manager reads, and what
# differs from build to build.
REMOVED = (
    "etc/apt", "etc/machine-id", "etc/hostname", "etc/resolv.conf", "etc/*-", "etc/ssh/ssh_host_*", "etc/dpkg",
    "etc/.pwd.lock", "var/lib/apt", "var/cache", "var/log", "var/lib/dbus/machine-id", "var/lib/systemd", "var/backups",
    DPKG, "usr/share/man", "usr/share/info", "usr/share/locale", "usr/share/lintian", "usr/share/bug",
    "usr/share/doc-base", "usr/share/bash-completion", "usr/share/zsh", "run", "tmp", "var/tmp", "dev", "proc", "sys",
    "boot", "*/__pycache__", "root/.ssh",
    # What packages depend on for what this box never does, 75 MB: perl's modules, character sets, hwdb's sources.
    "usr/share/perl", "usr/lib/*/perl", "usr/lib/*/libperl.so*", "usr/lib/*/gconv", "usr/lib/udev/hwdb.d",
    "usr/lib/systemd/system-generators/systemd-gpt-auto-generator",
    "usr/lib/systemd/system-generators/systemd-ssh-generator",
)  # fmt: skip
EMPTY = ("boot/firmware", "data", "dev", "etc/ssh", "proc", "run", "sys", "var/cache", "var/log", "var/lib/captain",
         "var/lib/rauc", "var/lib/chrony", "var/lib/private", "var/lib/systemd")  # fmt: skip
OPEN = ("tmp", "var/tmp")

# What Debian starts and this box does not need, or what would write where it should not.
MASKED = (
    "apt-daily.timer", "apt-daily-upgrade.timer", "dpkg-db-backup.timer", "e2scrub_all.timer", "e2scrub_reap.service",
    "getty@tty1.service", "systemd-timesyncd.service", "wpa_supplicant.service", "systemd-firstboot.service",
    "systemd-update-done.service", "ldconfig.service", "systemd-journal-catalog-update.service", "fstrim.timer",
    "systemd-machine-id-commit.service", "systemd-networkd-wait-online.service", "systemd-pcrmachine.service",
    "systemd-hwdb-update.service", "systemd-remount-fs.service", "systemd-random-seed.service",
)  # fmt: skip
WANTED = {
    "multi-user.target": (
        "captain.service", "captain-owner.service", "captain-grow.service", "captain-host-key.service",
        "captain-good.service", "chrony.service", "ssh.service", "systemd-networkd.service", "systemd-resolved.service",
    ),
    "sysinit.target": ("nftables.service",),
    "timers.target": ("captain-keep-clock.timer", "captain-unproven.timer"),
    "sockets.target": ("systemd-networkd.socket", "captain-restart.socket"),
}  # fmt: skip
_UNITS = "etc/systemd/system"
_FIELD = re.compile("^(Package|Status|Version): (.*)$", re.MULTILINE)


def install(packages: Sequence[Package], archives: Path, names: Sequence[str], target: Path) -> None:
    """Debian's userland as a tar: these packages and no others, their scripts run in emulation. Raises ImageError."""
    write_index(archives, packages)
    excluded = [f"/usr/share/{name}/*" for name in ("man", "locale", "info", "doc")]
    options = [f"--aptopt={option}" for option in ('Apt::Install-Recommends "false"', 'Acquire::Languages "none"')]
    options += [f"--dpkgopt=path-exclude={path}" for path in excluded]
    options += ["--dpkgopt=path-include=/usr/share/doc/*/copyright", "--dpkgopt=force-unsafe-io"]
    wanted = ["--variant=essential", "--architectures=arm64", "--format=tar", f"--include={','.join(names)}"]
    source = f"deb [trusted=yes] copy:{archives} ./"  # compared with apt's signed lists when they were fetched
    run(["mmdebstrap", "--quiet", *wanted, *options, "", target, source], environment={"SOURCE_DATE_EPOCH": EPOCH})


def installed(userland: Path) -> dict[str, str]:
    """Versions by package in such a tar, of which dpkg says so. Raises ImageError and OSError."""
    try:
        with tarfile.open(userland) as tar:
            status = tar.extractfile(f"./{DPKG}/status")
            text = status.read().decode() if status else ""
    except (tarfile.TarError, KeyError) as error:
        raise ImageError(f"{userland}: has no {DPKG}/status", "make image builds it again") from error
    heads = (dict(_FIELD.findall(part)) for part in text.split("\n\n"))
    return {head["Package"]: head["Version"] for head in heads if head.get("Status") == "install ok installed"}


class Parts(NamedTuple):
    """What a slot is put together from.

    userland   as install() made it; program: captain as a directory.
    documents  what is to be read about captain, by its place below its folder of documents.
    written    further files: path = text.
    """

    userland: Path
    kernel: Kernel
    initrd: Path
    program: Path
    documents: Mapping[str, bytes]
    written: Mapping[str, str]


def compose(description: Description, parts: Parts, epoch: int, target: Path) -> None:
    """The slot's files as a tar. epoch: date of every file, where a clock without a battery begins; Unix seconds."""
    with Tree() as tree:
        tree.add_tar(parts.userland)
        tree.remove(REMOVED)
        for folder in EMPTY:
            tree.folder(folder)
        for folder in OPEN:
            tree.folder(folder, 0o1777)
        _add_unpacked(tree, parts.kernel, parts.initrd)
        tree.add_folder(parts.program, PLACE)
        tree.link("usr/bin/captain", "../lib/captain/captain")
        for path, octets in parts.documents.items():
            tree.write(f"{DOCUMENTS}/{path}", octets)
        for laid in overlaid(description):
            tree.write(*laid)
        for path, text in parts.written.items():
            tree.write(path, text)
        _name(tree, description.name)
        accounts.add(tree)
        _choose_units(tree)
        tree.save(target, epoch)


def _name(tree: Tree, name: str) -> None:
    tree.link("etc/resolv.conf", "/run/systemd/resolve/stub-resolv.conf")
    tree.link("etc/mtab", "../proc/self/mounts")
    tree.write("etc/machine-id", "")  # the early boot writes the one that is kept
    tree.write("etc/hostname", f"{name}\n")
    tree.write("etc/hosts", f"127.0.0.1 localhost\n127.0.1.1 {name}\n::1 localhost ip6-localhost\n")
    tree.write("usr/lib/clock-epoch", "")


def _add_unpacked(tree: Tree, kernel: Kernel, initrd: Path) -> None:
    """What came without its scripts: they would have made the links and the bundle below."""
    for folder in ("usr/lib/modules", "usr/lib/firmware", "usr/share/ca-certificates"):
        tree.add_folder(kernel.folder / folder, folder)
    for notice in sorted(kernel.folder.glob("usr/share/doc/*/copyright")):
        tree.write(notice.relative_to(kernel.folder).as_posix(), notice.read_bytes())
    authorities = sorted((kernel.folder / "usr/share/ca-certificates").rglob("*.crt"))
    tree.write("etc/ssl/certs/ca-certificates.crt", b"".join(path.read_bytes() for path in authorities))
    # Where OpenSSL looks by itself: OPENSSLDIR of Debian's build.
    tree.link("usr/lib/ssl/cert.pem", "/etc/ssl/certs/ca-certificates.crt")
    for name in ("regulatory.db", "regulatory.db.p7s"):
        tree.link(f"usr/lib/firmware/{name}", f"{name}-debian")  # signed by a key that Debian's kernel knows
    tree.write("boot/Image", kernel.image.read_bytes())
    tree.write("boot/initrd", initrd.read_bytes())


class Laid(NamedTuple):
    """A file of the overlay, with its words replaced."""

    path: str
    text: str
    mode: int


def overlaid(description: Description) -> Iterator[Laid]:
    """The overlay's files: @WORD@ stands for what the description says."""
    disk = description.disk
    words = {
        "@BOOT@": disk.partuuid("boot"),
        "@STATE@": disk.partuuid("state"),
        "@ROOT_A@": disk.partuuid("root-a"),
        "@ROOT_B@": disk.partuuid("root-b"),
        "@BOARD@": description.device_tree.board,
        "@COMPATIBLE@": description.compatible,
    }
    for source in sorted(path for path in OVERLAY.rglob("*") if path.is_file()):
        text = source.read_text()
        for word, value in words.items():
            text = text.replace(word, value)
        mode = 0o755 if source.stat().st_mode & 0o100 else 0o644
        yield Laid(source.relative_to(OVERLAY).as_posix(), text, mode)


def _choose_units(tree: Tree) -> None:
    """What is started: named here, whatever the packages' scripts have switched on."""
    tree.remove([f"{_UNITS}/*.wants", f"{_UNITS}/*.requires", f"{_UNITS}/dbus-*.service"])
    for unit in MASKED:
        tree.link(f"{_UNITS}/{unit}", "/dev/null")
    for target, units in WANTED.items():
        for unit in units:
            tree.link(f"{_UNITS}/{target}.wants/{unit}", f"/usr/lib/systemd/system/{unit}")
    tree.link(f"{_UNITS}/default.target", "/usr/lib/systemd/system/multi-user.target")
    for bus, unit in (("resolve1", "resolved"), ("network1", "networkd")):
        tree.link(f"{_UNITS}/dbus-org.freedesktop.{bus}.service", f"/usr/lib/systemd/system/systemd-{unit}.service")
