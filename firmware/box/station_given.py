"""What the station of a box is to be started with, and where each key of it stands."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from firmware.box.note import at
from firmware.box.toml_lines import line_of

OWN, BOARD = "captain.toml", "board.toml"
STATE = "/var/lib/captain/"  # STATE_DIRECTORY and ReadWritePaths of the image's captain.service


class StationFiles(NamedTuple):
    """What the station is to be started with.

    files     path = octets.
    places    what they are called on the card.
    scratch   an empty folder, in which they are read: paths in captain.toml begin there.
    board     the box's, unless there is a board.toml.
    defaults  captain.toml of the box, which the owner's is laid over, where this is the box.
    own       address and length of its network that box.toml gives to eth0; empty: none.
    wifi      whether box.toml has wlan0 join a network.
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
        """Where a key stands."""
        text = self.files[name].decode() if name in self.files else ""
        return at(self.places.get(name, name), line_of(text, path))
