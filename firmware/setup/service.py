"""Settings of the station's service: its board, and the groups of its user."""

import re
import shlex

from firmware.setup.kept import Kept
from firmware.setup.setting import Setting

DEFAULTS = "etc/default/captain"
KEY = "CAPTAIN_BOARD"
USER = "captain"
GROUPS = ("dialout", "gpio", "i2c", "pps")  # groups of devices; captain-box creates them

_LINE = re.compile(rb"(?m)^[ \t]*CAPTAIN_BOARD=(.*)$")


def board_of(kept: Kept) -> str:
    """Return the board of the service; `none` without one. Raises StorageError if its file cannot be read."""
    found = _LINE.findall(kept.read(DEFAULTS) or b"")
    try:
        return " ".join(shlex.split(found[-1].decode("utf-8", "replace"), comments=True)) if found else "none"
    except ValueError:  # a quote without its end
        return "none"


class BoardChoice:
    """The board in /etc/default/captain. board: name, or absolute path of a board file."""

    def __init__(self, kept: Kept, board: str) -> None:
        self._kept = kept
        self._board = board

    def lacking(self) -> list[Setting]:
        """Return the line with the board if the file has another one. Raises StorageError if it cannot be read."""
        now = board_of(self._kept)
        why = f"the service's board; now {now}"
        return [Setting(f"/{DEFAULTS}", f"{KEY}={self._board}", why)] if now != self._board else []

    def make(self) -> None:
        """Write the line. Raises StorageError if that fails."""
        line = f"{KEY}={shlex.quote(self._board)}".encode()
        now = self._kept.read(DEFAULTS) or b""
        if _LINE.search(now):
            self._kept.write(DEFAULTS, _LINE.sub(lambda _: line, now))
        else:
            self._kept.append(DEFAULTS, line + b"\n")


class Groups:
    """Groups of the station's user."""

    def __init__(self, kept: Kept) -> None:
        self._kept = kept

    def lacking(self) -> list[Setting]:
        """Return the groups that the user is not in. Raises StorageError if /etc/group cannot be read."""
        rows = [row.split(":") for row in (self._kept.read("etc/group") or b"").decode("utf-8", "replace").splitlines()]
        own = {row[0] for row in rows if len(row) == 4 and USER in row[3].split(",")}
        return [
            Setting("/etc/group", f"{USER} in {name}", "devices of the board") for name in GROUPS if name not in own
        ]

    def make(self) -> None:
        """Add the user to the groups. Raises InterfaceError if a group is missing."""
        for one in self.lacking():
            group = one.line.split()[-1]
            self._kept.run(["usermod", "--append", "--groups", group, USER], ["gpasswd", "--delete", USER, group])
