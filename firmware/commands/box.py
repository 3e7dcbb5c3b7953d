"""captain box: checks the owner's files of a box's card."""

import argparse
import errno
import sys
import tempfile
import time
from pathlib import Path

from board.runtime.errors import ConfigurationError, InterfaceError, UsageError
from firmware.card import owner
from firmware.card.store import Store
from firmware.card.verdict import Verdict, verdict
from firmware.config import board_file
from firmware.printable import clean, folded

DESCRIPTION = """\
Checks the owner's files on the first partition of a box's card, as the box
does at its next start. The files are captain.toml, box.toml, authorized_keys,
board.toml, mqtt/, lib/ and those of Raspberry Pi Imager. Reports each mistake
with file and line. Writes nothing.
"""
EPILOG = """\
examples:
  captain box check /media/me/BOOT         the card, still in the laptop
  captain box check ./my-box               a folder, before you copy it to the card

exit codes:
  0    the box will take the files
  1    it will not; the last accepted set stays in force
  2    wrong usage
"""
HINT = "name the mount point of the card's first partition"
SCRATCH_HINT = "make room there, or set TMPDIR to a folder with 32 MB: the files are read from a copy"
BOARD = "quad"  # board of the image


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("do", choices=("check", "apply"), metavar="check", help="check the files")
    parser.add_argument(
        "folder",
        type=_folder,
        metavar="DIR",
        help="mount point of the card's first partition, or a folder with the same files",
    )
    parser.add_argument("--board", default=BOARD, help=f"board of the box, without a board.toml (default {BOARD})")
    # `apply` and its options are for captain-owner.service on the box only.
    for option in ("--key", "--owner", "--defaults"):
        parser.add_argument(option, help=argparse.SUPPRESS)


def _folder(text: str) -> Path:
    if not text:
        raise argparse.ArgumentTypeError('"": name a folder')
    return Path(text)


def main(arguments: argparse.Namespace) -> int:
    """Check the owner's files on a card, or apply them to the box.

    Raises UsageError for apply without its two options, InterfaceError if the data partition cannot be written.
    """
    return _apply(arguments) if arguments.do == "apply" else _check(arguments)


def _check(arguments: argparse.Namespace) -> int:
    board = _board(arguments.board)
    found = _verdict(arguments.folder, board, None)
    for note in found.notes:
        print(folded(clean(f"{'WRONG' if note.is_mistake else 'note':6} {note.text}"), sys.stdout))
    said = "the box will take it" if found.is_accepted else "the box will NOT take it"
    print(folded(clean(f"{said}: {owner.content(found)}"), sys.stdout))
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
