"""A machine like one with Raspberry Pi OS and captain-box, below a folder."""

from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from board.runtime.errors import InterfaceError
from firmware.setup import setup
from firmware.setup.kept import Kept

# The file of Raspberry Pi OS ends with [all]; an owner's may end below another filter.
CONFIG = "# For more options see the documentation\ndtparam=audio=on\n\n[cm4]\notg_mode=1\n\n[all]\n"
FILTERED = f"{CONFIG}[pi5]\ndtoverlay=uart3-pi5\n"
COMMAND_LINE = "console=serial0,115200 console=tty1 root=PARTUUID=1-02 rootwait cfg80211.ieee80211_regdom=DE\n"
DEFAULTS = "# Board of this machine.\nCAPTAIN_BOARD=none\nCAPTAIN_OPTIONS=\n"
GROUPS = "root:x:0:\ndialout:x:20:me,captain\ngpio:x:986:captain\ni2c:x:994:me\npps:x:995:captain\n"

# A receiver at the header's first UART, a sensor at a second I2C bus.
MINE = """
name = "mine"
[buses.main]
path = "/dev/i2c-1"
[buses.second]
path = "/dev/i2c-3"
[pulse]
device = "/dev/pps0"
gpio = 17
edge = "falling"
[interfaces.gnss]
driver = "zed_f9p"
port = "{port}"
"""
CAPTAIN_TXT, CONFIG_TXT, CMDLINE = (f"boot/firmware/{name}.txt" for name in ("captain", "config", "cmdline"))


class Machine:
    """Root with the files of such a system; runs gpasswd, usermod and systemctl on them."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.said: list[str] = []
        self.fails = ""
        self.write("boot/firmware/config.txt", CONFIG)
        self.write("boot/firmware/cmdline.txt", COMMAND_LINE)
        self.write("etc/default/captain", DEFAULTS)
        self.write("etc/group", GROUPS)
        self.write("proc/device-tree/model", "Raspberry Pi 4 Model B Rev 1.4\0")
        self.write("usr/sbin/nft", "")
        rules = Path(__file__).parents[3] / "image/overlay/etc/nftables.conf"
        self.write("usr/share/captain/nftables.conf", rules.read_text())

    def write(self, name: str, text: str) -> Path:
        path = self.root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        return path

    def read(self, name: str) -> str:
        return (self.root / name).read_text()

    def run(self, words: Sequence[str]) -> None:
        """Record a command; change /etc/group and links as it does."""
        self.said.append(" ".join(words))
        if self.fails and self.fails in self.said[-1]:
            raise InterfaceError(f"{self.said[-1]}: failed")
        match list(words):
            case ["usermod", "--append", "--groups", group, user]:
                self._members(group, lambda members: [*members, user])
            case ["gpasswd", "--delete", user, group]:
                self._members(group, lambda members: [one for one in members if one != user])
            case ["systemctl", "enable", *_, unit]:
                link = self.root / f"etc/systemd/system/sysinit.target.wants/{unit}"
                link.parent.mkdir(parents=True)
                link.symlink_to(f"/usr/lib/systemd/system/{unit}")
            case ["systemctl", "disable", *_, unit]:
                link = self.root / f"etc/systemd/system/sysinit.target.wants/{unit}"
                link.unlink()
                link.parent.rmdir()

    def state(self) -> dict[str, str]:
        """Return all files with their octets, and the targets of links."""
        paths = [path for path in self.root.rglob("*") if path.is_file() or path.is_symlink()]
        return {
            str(path.relative_to(self.root)): str(path.readlink()) if path.is_symlink() else path.read_bytes().hex()
            for path in paths
        }

    def _members(self, group: str, change: Callable[[list[str]], list[str]]) -> None:
        rows = [row.split(":") for row in self.read("etc/group").splitlines()]
        for row in rows:
            if row[0] == group:
                row[3] = ",".join(change(list(filter(None, row[3].split(",")))))
        self.write("etc/group", "".join(":".join(row) + "\n" for row in rows))


def mine(machine: Machine, port: str = "/dev/serial0") -> str:
    return str(machine.write("etc/captain/mine.toml", MINE.format(port=port)))


def lines(machine: Machine, board: str = "pi", pi: int = 4, has_firewall: bool = False) -> list[str]:
    parts = setup.parts(Kept(machine.root, machine.run), board, pi, has_firewall)
    return [f"{one.file}: {one.line}" for one in setup.lacking(parts)]


def make(machine: Machine, board: str = "pi", pi: int = 4, has_firewall: bool = False) -> None:
    kept = Kept(machine.root, machine.run)
    for part in setup.parts(kept, board, pi, has_firewall):
        if part.lacking():
            part.make()


def undo(machine: Machine) -> list[str]:
    return list(Kept(machine.root, machine.run).undo())


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    return Machine(tmp_path / "root")
