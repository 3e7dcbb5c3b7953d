"""Checks of the settings that `captain box setup` makes."""

from collections.abc import Iterator
from pathlib import Path

from board.pi import overlays
from board.runtime.errors import StationError
from firmware.doctor.finding import Finding, Level
from firmware.setup import setup
from firmware.setup.kept import Kept

REMEDY = "sudo captain box setup --write"


def missing(root: Path = Path("/")) -> Iterator[Finding]:
    """Yield a finding for each setting that a machine with captain-box lacks for the board of its service."""
    if not setup.is_for(root):
        return
    try:
        kept = Kept(root)
        board = setup.board_name(kept, None)
        found = setup.lacking(setup.parts(kept, board, overlays.generation(setup.model(root))))
    except StationError as error:
        yield Finding(Level.WARNING, "setup", error.message, error.hint)
        return
    for setting in found:
        yield Finding(Level.WARNING, "setup", f"missing: {setting}", REMEDY)
    if not found:
        yield Finding(Level.OK, "setup", f"this machine has all settings for board {board}")
