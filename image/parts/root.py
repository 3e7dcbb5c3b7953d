"""Root file system: Debian's userland and our files, without build traces."""

import re
import tarfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from image.description import Description
from image.errors import ImageError
from image.filesystem.tree import Tree
from image.own_files import CARD, OVERLAY, formed
from image.packages import Package, write_index
from image.parts import accounts
from image.parts.kernel import Kernel
from image.tool import run

PLACE = "usr/lib/captain"  # folder of the program
DOCUMENTS = "usr/share/doc/captain"
DPKG = "var/lib/dpkg"

# Fixed date for scripts that write times into files, such as the day of an account.
EPOCH = "1735689600"  # 2025-01-01

# Removed files: they contain the place of the build, belong to one box, serve only a package manager, or differ from
# build to build.
REMOVED = (
    "etc/apt", "etc/machine-id", "etc/hostname", "etc/resolv.conf", "etc/*-", "etc/ssh/ssh_host_*", "etc/dpkg",
    "etc/.pwd.lock", "var/lib/apt", "var/cache", "var/log", "var/lib/dbus/machine-id", "var/lib/systemd", "var/backups",
    DPKG, "usr/share/man", "usr/share/info", "usr/share/locale", "usr/share/lintian", "usr/share/bug",
    "usr/share/doc-base", "usr/share/bash-completion", "usr/share/zsh", "run", "tmp", "var/tmp", "dev", "proc", "sys",
    "boot", "*/__pycache__", "root/.ssh",
    # Parts of packages that this box never uses, 75 MB: perl's modules, character sets, sources of hwdb.
    "usr/share/perl", "usr/lib/*/perl", "usr/lib/*/libperl.so*", "usr/lib/*/gconv", "usr/lib/udev/hwdb.d",
    "usr/lib/systemd/system-generators/systemd-gpt-auto-generator",
    "usr/lib/systemd/system-generators/systemd-ssh-generator",
)  # fmt: skip
EMPTY = ("boot/firmware", "data", "dev", "etc/ssh", "proc", "run", "sys", "var/cache", "var/log", "var/lib/captain",
         "var/lib/rauc", "var/lib/chrony", "var/lib/private", "var/lib/systemd")  # fmt: skip
OPEN = ("tmp", "var/tmp")

# Units of Debian that this box does not need, or that would write to a read-only place.
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
    source = f"deb [trusted=yes] copy:{archives} ./"  # checked by apt's signed lists after the download
    run(["mmdebstrap", "--quiet", *wanted, *options, "", target, source], environment={"SOURCE_DATE_EPOCH": EPOCH})


def installed(userland: Path) -> dict[str, str]:
    """Return versions by name of the packages that dpkg lists as installed in a userland tar.

    Raises ImageError if it is not a tar, or has no status of dpkg; OSError if it cannot be read.
    """
    try:
        with tarfile.open(userland) as tar:
            status = tar.extractfile(f"./{DPKG}/status")
            text = status.read().decode() if status else ""
    except (tarfile.TarError, KeyError) as error:
        raise ImageError(f"{userland}: has no {DPKG}/status", "make image builds it again") from error
    heads = (dict(_FIELD.findall(part)) for part in text.split("\n\n"))
    return {head["Package"]: head["Version"] for head in heads if head.get("Status") == "install ok installed"}


class Parts(NamedTuple):
    """Parts of a slot.

    userland   tar that install() made.
    program    captain as a directory.
    documents  documents of captain, by path below their folder.
    written    text of further files, by path.
    """

    userland: Path
    kernel: Kernel
    initrd: Path
    program: Path
    documents: Mapping[str, bytes]
    written: Mapping[str, str]


def compose(description: Description, parts: Parts, epoch: int, target: Path) -> None:
    """Write the slot's files as a tar. epoch: date of all files, and first time of a clock without battery; Unix s."""
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
    tree.write("etc/machine-id", "")  # the early boot writes the box's own
    tree.write("etc/hostname", f"{name}\n")
    tree.write("etc/hosts", f"127.0.0.1 localhost\n127.0.1.1 {name}\n::1 localhost ip6-localhost\n")
    tree.write("usr/lib/clock-epoch", "")


def _add_unpacked(tree: Tree, kernel: Kernel, initrd: Path) -> None:
    """Add kernel, firmware and certificates, with the links and the bundle that their packages' scripts would make."""
    for folder in ("usr/lib/modules", "usr/lib/firmware", "usr/share/ca-certificates"):
        tree.add_folder(kernel.folder / folder, folder)
    for notice in sorted(kernel.folder.glob("usr/share/doc/*/copyright")):
        tree.write(notice.relative_to(kernel.folder).as_posix(), notice.read_bytes())
    authorities = sorted((kernel.folder / "usr/share/ca-certificates").rglob("*.crt"))
    tree.write("etc/ssl/certs/ca-certificates.crt", b"".join(path.read_bytes() for path in authorities))
    # Default place of OpenSSL: OPENSSLDIR of Debian's build.
    tree.link("usr/lib/ssl/cert.pem", "/etc/ssl/certs/ca-certificates.crt")
    for name in ("regulatory.db", "regulatory.db.p7s"):
        tree.link(f"usr/lib/firmware/{name}", f"{name}-debian")  # Debian's kernel knows the key that signed this one
    tree.write("boot/Image", kernel.image.read_bytes())
    tree.write("boot/initrd", initrd.read_bytes())


class Laid(NamedTuple):
    """File of the overlay, with its placeholders replaced."""

    path: str
    text: str
    mode: int


def overlaid(description: Description) -> Iterator[Laid]:
    """Yield the overlay's files in the card's form; each @PLACEHOLDER@ is replaced by a value of the description."""
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
        text = formed(source.read_text(), CARD)
        for word, value in words.items():
            text = text.replace(word, value)
        mode = 0o755 if source.stat().st_mode & 0o100 else 0o644
        yield Laid(source.relative_to(OVERLAY).as_posix(), text, mode)


def _choose_units(tree: Tree) -> None:
    """Enable exactly the units that are named here, whatever the packages' scripts enabled."""
    tree.remove([f"{_UNITS}/*.wants", f"{_UNITS}/*.requires", f"{_UNITS}/dbus-*.service"])
    for unit in MASKED:
        tree.link(f"{_UNITS}/{unit}", "/dev/null")
    for target, units in WANTED.items():
        for unit in units:
            tree.link(f"{_UNITS}/{target}.wants/{unit}", f"/usr/lib/systemd/system/{unit}")
    tree.link(f"{_UNITS}/default.target", "/usr/lib/systemd/system/multi-user.target")
    for bus, unit in (("resolve1", "resolved"), ("network1", "networkd")):
        tree.link(f"{_UNITS}/dbus-org.freedesktop.{bus}.service", f"/usr/lib/systemd/system/systemd-{unit}.service")
