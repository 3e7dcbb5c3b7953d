"""Options of a box's station, with the source of each key."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from firmware.card.note import at
from firmware.card.toml_lines import line_of

OWN, BOARD = "captain.toml", "board.toml"
STATE = "/var/lib/captain/"  # STATE_DIRECTORY and ReadWritePaths of the image's captain.service


class StationFiles(NamedTuple):
    """Files and settings with which the station is checked.

    files     octets by path.
    places    names of the files on the card.
    scratch   empty folder into which they are written; paths in captain.toml are relative to it.
    board     board file of the box, unless the set has a board.toml.
    defaults  captain.toml of the box, under the owner's; None if this machine is not the box.
    own       address with prefix length that box.toml gives to eth0; empty: none.
    wifi      box.toml configures a network for wlan0.
    now       Unix time.
    """

    files: Mapping[str, bytes]
    places: Mapping[str, str]
    scratch: Path
    board: str
    defaults: str | None
    own: str
    wifi: bool
    now: float

    def at(self, name: str, path: str) -> str:
        """Return file and line of a key."""
        text = self.files[name].decode() if name in self.files else ""
        return at(self.places.get(name, name), line_of(text, path))
