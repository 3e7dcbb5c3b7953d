"""Setup of a machine for a board: its parts, and the machines that it refuses."""

import os
from pathlib import Path

from board.pi import overlays
from board.runtime.errors import ConfigurationError, UsageError
from firmware.config import board_file
from firmware.config.board_file import Board
from firmware.setup.config_txt import ConfigTxt
from firmware.setup.console import Console
from firmware.setup.firewall import RULES, Firewall
from firmware.setup.kept import Kept
from firmware.setup.service import BoardChoice, Groups, board_of
from firmware.setup.setting import Part, Setting

CARD = "run/captain-image"  # only on the card of a box
MODEL = "proc/device-tree/model"
BOOT = "boot/firmware"
HIDDEN = ("/home", "/root", "/run/user", "/tmp", "/var/tmp")  # ProtectHome= and PrivateTmp= of the service


def is_for(root: Path) -> bool:
    """Return True if the machine has captain-box, and is not the card of a box, where all settings are made."""
    return (root / RULES).exists() and not (root / CARD).exists()


def check(root: Path) -> None:
    """Raise UsageError for a machine that needs no setup, or cannot have one."""
    if (root / CARD).exists():
        raise UsageError("this is the card of a box: it has all settings", "its files: image/guide/flash.md")
    if not is_for(root):
        raise UsageError("captain-box is not installed", "sudo apt install ./captain-box_VERSION_all.deb")


def model(root: Path) -> str:
    """Return the name of this machine in its device tree; empty without one."""
    try:
        return (root / MODEL).read_text(errors="replace").rstrip("\0\n")
    except OSError:
        return ""


def board_name(kept: Kept, wanted: str | None) -> str:
    """Return a name or an absolute path for the service: the wanted board, else that of /etc/default/captain.

    Raises UsageError for a path that the service may not read, StorageError if the file cannot be read.
    """
    if not wanted:
        return board_of(kept)
    path = board_file.path_of(wanted)
    if path.parent == board_file.BOARDS:
        return wanted
    name = str(path.absolute())
    if any(Path(name).is_relative_to(folder) for folder in HIDDEN):
        raise UsageError(f"--board: {name}: the service may not read this folder", f"sudo cp {name} /etc/captain/")
    return name


def parts(kept: Kept, board: str, pi: int, has_firewall: bool = False) -> list[Part]:
    """Return the parts of a setup.

    board         as board_name() returns it.
    pi            generation of the Raspberry Pi; 0: another machine, which has no config.txt.
    has_firewall  the firewall is a part, too.

    Raises ConfigurationError for an invalid board file or a GPIO used twice, UsageError for a Pi without config.txt.
    """
    found: list[Part] = [BoardChoice(kept, board), Groups(kept)]
    described = board_file.load(board)
    if pi:
        ports = ports_of(described)
        lines = overlays.lines(described, ports, pi)
        if twice := overlays.used_twice(lines):
            gpio, *keys = twice
            raise ConfigurationError(f"{' and '.join(keys)}: both use GPIO {gpio}", "choose another GPIO, bus or port")
        has_config = (kept.root / BOOT / "config.txt").exists()
        if lines and not has_config:
            raise UsageError(f"/{BOOT}: has no config.txt", "mount the boot partition")
        if has_config:
            filters = overlays.filters(model(kept.root), pi)
            found += [ConfigTxt(kept, BOOT, lines, filters), Console(kept, BOOT, ports, pi)]
    return [*found, Firewall(kept)] if has_firewall else found


def lacking(found: list[Part]) -> list[Setting]:
    """Return all settings that are not made. Raises StationError if a file cannot be read."""
    return [setting for part in found for setting in part.lacking()]


def check_writable(root: Path) -> None:
    """Raise UsageError if the user may not write the settings, or their file system is read-only."""
    if root == Path("/") and os.geteuid() != 0:
        raise UsageError("only root may change settings", "repeat the command with sudo")
    if (root / BOOT).exists() and not os.access(root / BOOT, os.W_OK):
        raise UsageError(f"/{BOOT}: is read-only", f"sudo mount -o remount,rw /{BOOT}")


def ports_of(board: Board) -> dict[str, str]:
    """Return the serial ports of the board file's interfaces, by key: {"interfaces.gnss": "/dev/ttyAMA3"}."""
    ports = {name: options.get(board_file.serial_option(options)) for name, options in board.interfaces.items()}
    return {f"interfaces.{name}": port for name, port in ports.items() if isinstance(port, str)}
