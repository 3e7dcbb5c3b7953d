"""Man pages and completion as files of the packages and the card."""

import argparse
from datetime import UTC, datetime

import shtab

from firmware.cli import GROUPS, USAGE, VERBS, load
from image.manual import page

MAN = "usr/share/man/man1"
COMPLETION = {
    "bash": "usr/share/bash-completion/completions/captain",
    "zsh": "usr/share/zsh/vendor-completions/_captain",
    "fish": "usr/share/fish/vendor_completions.d/captain.fish",
}
SUMMARY = "station software of a V2X box: every radio behind one ZeroMQ endpoint"
# Beginnings of the placeholders of arguments that shells complete as paths.
_PATHS = dict.fromkeys(("BOARD", "FILE", "PATH", "WHAT"), shtab.FILE) | {"DIR": shtab.DIR, "FOLDER": shtab.DIR}


def made(version: str, epoch: int) -> dict[str, str]:
    """Return the text of each file by its path below the root: man pages, and completion of bash, zsh and fish.

    epoch  date of the man pages, Unix seconds.
    """
    head = page.Head(version, datetime.fromtimestamp(epoch, UTC).date().isoformat())
    program, commands = parsers()
    pages = {"captain": page.overview("captain", SUMMARY, USAGE, GROUPS, head)}
    for verb, parser in commands.items():
        pages[f"captain-{verb}"] = page.of(parser, VERBS[verb], head)
        _prepare(parser, VERBS[verb])
    texts = {f"{MAN}/{name}.1": text for name, text in pages.items()}
    return texts | {path: shtab.complete(program, shell) for shell, path in COMPLETION.items()}


def parsers() -> tuple[argparse.ArgumentParser, dict[str, argparse.ArgumentParser]]:
    """Return the parser of `captain`, and those of its commands by name, with the plain classes of argparse."""
    program = argparse.ArgumentParser("captain")
    program.add_argument("--version", "-V", action="store_true", help="print the version")
    commands = program.add_subparsers(metavar="COMMAND")
    for verb, summary in VERBS.items():
        command = load(verb)
        # prog: Python 3.14 colours the one that it composes.
        parser = commands.add_parser(
            verb, prog=f"captain {verb}", help=summary, description=command.DESCRIPTION, epilog=command.EPILOG
        )
        command.arguments(parser)
    return program, commands.choices


def _prepare(parser: argparse.ArgumentParser, summary: str) -> None:
    """Give shtab the summary in place of the description, and paths; leave out choices that the help does not name."""
    parser.description = summary  # zsh and fish show it in a line beside the command
    for action in parser._actions:
        if action.choices and str(action.metavar).startswith("{"):
            action.choices = [one for one in action.choices if one in str(action.metavar)]
        for beginning, complete in _PATHS.items():
            if str(action.metavar or action.dest.upper()).startswith(beginning):
                action.complete = complete  # type: ignore[attr-defined]  # shtab reads it
