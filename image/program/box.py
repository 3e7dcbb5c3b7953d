"""Debian package captain-box: drop-ins that make a box of a Debian machine."""

import tempfile
from pathlib import Path

from image import own_files
from image.parts import device_tree, slot_names
from image.program import deb, frozen
from image.project import PROJECT, chrony_beside

NAME = "captain-box"
SCRIPTS = deb.FILES / "box"
BOARD = "quad"  # the board file with slots; /dev/slot has their names
COPYRIGHT = f"usr/share/doc/{NAME}/copyright"

# Places in the package of files of the overlay. The last two are not in force: in their places on a card, they would
# replace the owner's firewall and login.
PLACES = {
    "usr/lib/udev/rules.d/70-captain.rules": "usr/lib/udev/rules.d/70-captain.rules",
    "usr/lib/sysctl.d/70-captain.conf": "usr/lib/sysctl.d/70-captain.conf",
    "usr/lib/modules-load.d/captain.conf": "usr/lib/modules-load.d/captain.conf",
    "usr/lib/systemd/network/40-radio.network": "usr/lib/systemd/network/90-captain-radio.network",
    "usr/lib/systemd/network/50-wwan0.network": "usr/lib/systemd/network/90-captain-wwan.network",
    "etc/nftables.conf": "usr/share/captain/nftables.conf",
    "etc/systemd/system/serial-getty@.service.d/captain.conf": "usr/share/captain/serial-console.conf",
}

_RELATIONS = "Depends: captain (>= {version}), passwd, udev\nRecommends: chrony\nSuggests: nftables"
_SYNOPSIS = "drop-ins that make a V2X box of a Debian machine"
_DESCRIPTION = """\
 Groups and names of the modules' devices, pulses as a source of chronyd, and buffers
 of sockets. NetworkManager leaves the networks of radio and 5G module alone.
 .
 It replaces no file of another package. Cable, Wi-Fi, firewall and logins remain
 those of the machine's owner; /usr/share/captain has a firewall and a console.
"""


def make(version: str, epoch: int, target: Path) -> None:
    """Make the package; equal sources give equal octets.

    epoch  date of all files, Unix seconds.

    Raises ImageError if a tool fails.
    """
    with tempfile.TemporaryDirectory() as name:
        root = Path(name) / "package"
        for path, text in files().items():
            deb.write(root / path, text.encode())
        about = deb.About(NAME, version, "all", _RELATIONS.format(version=version), _SYNOPSIS, _DESCRIPTION)
        deb.build(root, about, SCRIPTS, epoch, target)


def files() -> dict[str, str]:
    """Return the package's files by path. Raises ImageError if the station's code cannot generate those of chrony."""
    board = device_tree.read_board(PROJECT / f"board/boards/{BOARD}.toml")
    found = {place: own_files.read(path, own_files.PACKAGE) for path, place in PLACES.items()}
    return found | {
        slot_names.PATH: slot_names.rules(board),
        COPYRIGHT: (PROJECT / "LICENSE").read_text(),
        **chrony_beside(frozen.own_python()),
    }
