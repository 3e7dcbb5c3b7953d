"""captain box: the owner's files of a box's card, before they are in it."""

import argparse
import errno
import tempfile
import time
from pathlib import Path

from board.errors import ConfigurationError, InterfaceError, UsageError
from firmware import board_file
from firmware.box import owner
from firmware.box.store import Store
from firmware.box.verdict import Verdict, verdict
from firmware.printable import clean

DESCRIPTION = """\
Looks at the files that an owner puts on the first partition of a box's card,
as the box itself will at its next start: captain.toml, box.toml,
authorized_keys, board.toml, mqtt/, and what Raspberry Pi Imager writes there.
Nothing is written. Each mistake is told with its file and line.
"""
EPILOG = """\
examples:
  captain box check /media/me/BOOT         the card, still in the laptop
  captain box check ./my-box               a folder that is to be copied there

exit codes:
  0    the box will take them
  1    it will not; what it took before stays in force
  2    wrong usage
"""
HINT = "name the folder that the card's first partition is mounted at"
SCRATCH_HINT = "make room there, or set TMPDIR to a folder with 32 MB: the files are read from a copy"
BOARD = "quad"  # of the image


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("do", choices=("check", "apply"), metavar="check", help="what to do")
    parser.add_argument("folder", type=_folder, metavar="DIR", help="the card's first partition, or a folder like it")
    parser.add_argument("--board", default=BOARD, help=f"that the box has, without a board.toml (default {BOARD})")
    # `apply` is for the box itself: captain-owner.service.
    for option in ("--key", "--owner", "--defaults"):
        parser.add_argument(option, help=argparse.SUPPRESS)


def _folder(text: str) -> Path:
    if not text:
        raise argparse.ArgumentTypeError('"" is no name of a folder')
    return Path(text)


def main(arguments: argparse.Namespace) -> int:
    return _apply(arguments) if arguments.do == "apply" else _check(arguments)


def _check(arguments: argparse.Namespace) -> int:
    board = _board(arguments.board)
    found = _verdict(arguments.folder, board, None)
    for note in found.notes:
        print(clean(f"{'WRONG' if note.is_mistake else 'note':6} {note.text}"))
    said = "the box will take it" if found.is_accepted else "the box will NOT take it"
    print(clean(f"{said}: {owner.content(found)}"))
    return 0 if found.is_accepted else 1


def _board(board: str) -> str:
    """The whole path of a sound one: it is read from another folder than the command is given in."""
    try:
        board_file.load(board)
    except ConfigurationError as error:
        raise UsageError(f"--board: {error.message}", error.hint) from error
    return str(board_file.path_of(board).absolute())


def _apply(arguments: argparse.Namespace) -> int:
    if not (arguments.key and arguments.owner):
        raise UsageError("apply is for the box itself", "`captain box check DIR` looks at a card")
    store = Store(Path(arguments.owner))
    found = _verdict(arguments.folder, arguments.board, arguments.defaults)
    try:
        lines = owner.apply(found, store, arguments.key)
    except OSError as error:
        what = f"{error.filename or arguments.owner}: {error.strerror}"
        raise InterfaceError(what, "is the data partition full?") from error
    print(*map(clean, lines), sep="\n")
    return 0


def _verdict(folder: Path, board: str, defaults: str | None) -> Verdict:
    """What the box says of a folder. Raises InterfaceError: it, or the scratch beside it, cannot be read or written."""
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
