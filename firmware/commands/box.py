"""captain box: checks the owner's files of a box's card; sets up a machine for its board."""

import argparse
import errno
import shlex
import sys
import tempfile
import time
from pathlib import Path

from board.pi import overlays
from board.runtime.errors import ConfigurationError, InterfaceError, UsageError
from firmware.card import owner
from firmware.card.store import Store
from firmware.card.verdict import Verdict, verdict
from firmware.config import board_file
from firmware.printable import clean, folded
from firmware.setup import setup
from firmware.setup.kept import RECORD, Kept

DESCRIPTION = """\
check: checks the owner's files on the first partition of a box's card, as the
box does at its next start. The files are captain.toml, box.toml,
authorized_keys, board.toml, mqtt/, lib/ and those of Raspberry Pi Imager.
Reports each mistake with file and line. Writes nothing.

setup: on a machine with the package captain-box, prints each setting that is
missing for the board: its file, its line, and what needs it. The settings are
device tree overlays of a Raspberry Pi, serial ports without a console, groups
and the service's board.
"""
EPILOG = """\
examples:
  captain box check /media/me/BOOT         the card, still in the laptop
  captain box check ./my-box               a folder, before it is on the card
  captain box setup --board pi             what this Raspberry Pi lacks
  sudo captain box setup --board pi --write
  sudo captain box setup --undo            as it was before

exit codes:
  0    the box will take the files; no setting is missing
  1    the box will not, the last accepted set stays in force; a setting is
       missing, or could not be made or reverted
  2    wrong usage, or a machine that cannot have a setup
"""
HINT = "name the mount point of the card's first partition"
SCRATCH_HINT = "make room there, or set TMPDIR to a folder with 32 MB: the files are read from a copy"
BOARD = "quad"  # board of the image
ROOT = Path("/")  # root of the machine for setup


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "do", choices=("check", "setup", "apply"), metavar="{check,setup}", help="check the files; set up this machine"
    )
    parser.add_argument(
        "folder",
        nargs="?",
        type=_folder,
        metavar="DIR",
        help="with check: mount point of the card's first partition, or a folder with the same files",
    )
    parser.add_argument(
        "--board",
        help=f"name or file of the board (default: with check {BOARD}, unless the files have a board.toml; with setup "
        "that of /etc/default/captain)",
    )
    group = parser.add_argument_group("setup")
    how = group.add_mutually_exclusive_group()
    how.add_argument("--write", action="store_true", help="make the settings; root only")
    how.add_argument("--undo", action="store_true", help="revert all settings that were made; root only")
    group.add_argument(
        "--firewall",
        action="store_true",
        help="the firewall of a box is a setting, too; shows the ports that it closes",
    )
    group.add_argument(
        "--pi", type=int, choices=(4, 5), help="generation of the Raspberry Pi, for a card of another machine"
    )
    # `apply` and its options are for captain-owner.service on the box only.
    for option in ("--key", "--owner", "--defaults"):
        parser.add_argument(option, help=argparse.SUPPRESS)


def _folder(text: str) -> Path:
    if not text:
        raise argparse.ArgumentTypeError('"": name a folder')
    return Path(text)


def main(arguments: argparse.Namespace) -> int:
    """Check the owner's files on a card, apply them to the box, or set up a machine.

    Raises UsageError for options of another action and for a machine that cannot have a setup, StationError if a file
    or the data partition cannot be written.
    """
    is_setup = arguments.do == "setup"
    if is_setup == bool(arguments.folder):
        raise UsageError(f"{arguments.do}: {'takes no folder' if is_setup else 'DIR is missing'}", "captain box --help")
    if not is_setup and (arguments.write or arguments.undo or arguments.firewall or arguments.pi):
        raise UsageError(f"{arguments.do}: has no options of setup", "captain box --help")
    if is_setup:
        return _undo() if arguments.undo else _setup(arguments)
    arguments.board = arguments.board or BOARD
    return _apply(arguments) if arguments.do == "apply" else _check(arguments)


def _setup(arguments: argparse.Namespace) -> int:
    setup.check(ROOT)
    if arguments.write:
        setup.check_writable(ROOT)
    if arguments.board:
        _board(arguments.board)
    kept = Kept(ROOT)
    pi = arguments.pi or overlays.generation(setup.model(ROOT))
    board = setup.board_name(kept, arguments.board)
    parts = setup.parts(kept, board, pi, arguments.firewall)
    missing = setup.lacking(parts)
    for setting in missing:
        _say(str(setting))
    if not pi:
        _say(f"not a Raspberry Pi{f', but {name}' if (name := setup.model(ROOT)) else ''}: no overlays")
    if board == "none":
        _say("board none has no devices; --board names another: pi, quad, or a file")
    if not missing:
        _say("no setting is missing")
        return 0
    if not arguments.write:
        given = f" --board {shlex.quote(board)}" if arguments.board else ""
        given += f" --pi {arguments.pi}" if arguments.pi else ""
        given += " --firewall" if arguments.firewall else ""
        _say(f"missing: {len(missing)}; to make them: sudo captain box setup{given} --write")
        return 1
    for part in parts:
        if part.lacking():
            part.make()
    kept.reload()
    _say(f"made: {len(missing)}; reboot once: sudo reboot")
    return 0


def _undo() -> int:
    setup.check_writable(ROOT)
    kept = Kept(ROOT)
    if kept.is_empty:
        _say("no settings of captain box setup are made")
        return 0
    for line in kept.undo():
        _say(line)
    if not kept.is_empty:
        _say(f"not all is reverted; repeat the command, or revert the rest by hand: sudo rm /{RECORD}")
        return 1
    _say("reverted; reboot once: sudo reboot")
    return 0


def _say(line: str) -> None:
    print(folded(clean(line), sys.stdout))


def _check(arguments: argparse.Namespace) -> int:
    board = _board(arguments.board)
    found = _verdict(arguments.folder, board, None)
    for note in found.notes:
        _say(f"{'WRONG' if note.is_mistake else 'note':6} {note.text}")
    said = "the box will take it" if found.is_accepted else "the box will NOT take it"
    _say(f"{said}: {owner.content(found)}")
    return 0 if found.is_accepted else 1


def _board(board: str) -> str:
    """Return the absolute path of a valid board file, since the verdict runs in another folder. Raises UsageError."""
    try:
        board_file.load(board)
    except ConfigurationError as error:
        raise UsageError(f"--board: {error.message}", error.hint) from error
    return str(board_file.path_of(board).absolute())


def _apply(arguments: argparse.Namespace) -> int:
    if not (arguments.key and arguments.owner):
        raise UsageError("apply runs on the box only", "use `captain box check DIR`")
    store = Store(Path(arguments.owner))
    found = _verdict(arguments.folder, arguments.board, arguments.defaults)
    try:
        lines = owner.apply(found, store, arguments.key)
    except OSError as error:
        what = f"{error.filename or arguments.owner}: {error.strerror}"
        raise InterfaceError(what, "check the data partition: df /data") from error
    print(*map(clean, lines), sep="\n")
    return 0


def _verdict(folder: Path, board: str, defaults: str | None) -> Verdict:
    """Return the box's verdict on a folder.

    Raises InterfaceError if the folder cannot be read or the scratch copy not written.
    """
    where = Path(tempfile.gettempdir())
    try:
        with tempfile.TemporaryDirectory(prefix="captain-box-") as scratch:
            where = Path(scratch)
            return verdict(folder, where, board, defaults, time.time())
    except OSError as error:
        name = Path(error.filename or folder)
        if name.is_relative_to(where) or error.errno == errno.ENOSPC:
            raise InterfaceError(f"{where}: {error.strerror}", SCRATCH_HINT) from error
        raise InterfaceError(f"{name}: {error.strerror}", HINT) from error
