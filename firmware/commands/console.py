"""captain console: the status screen of the box's serial console."""

import argparse
import math
import os
import shlex
import sys

from board.runtime.errors import UsageError
from board.runtime.loop import Loop
from firmware.client.arguments import add_socket
from firmware.console.console import EVERY_S, Console, Options, once
from firmware.console.terminal import COLUMNS
from firmware.endpoint.control.control_socket import default_paths

DESCRIPTION = """\
Shows the status of this machine's station on a terminal of 80 columns and 24
lines, such as a serial line of 115200 baud. It has name, version and time,
slots, interfaces with their messages per second, position, addresses and the
last errors. Without a station it shows the state of its service. Keys turn
pages and open a shell.

The output is ASCII. The only escape codes are cursor home and erase, known to
every VT100. If TERM is "dumb" or not set, it prints screens without them.
"""
EPILOG = """\
examples:
  captain console
  captain console --once                        all pages, for scripts
  captain console --shell '/bin/bash --login' --stay --notes /run/captain/notes
                                                a service on a serial line
  captain console --plain --every 60            a line printer, or a log

exit codes:
  0    key q, hang-up of the terminal, or SIGTERM
  1    no terminal; with --once: no station answers
  2    wrong usage
  130  Ctrl-C
"""
PLAIN_EVERY_S = 30.0
LEAST_S, MOST_S = 2.0, 3600.0  # a station is asked every 2 s at most
FIRST_PORT = 5555


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--once", action="store_true", help="print all pages once and exit")
    parser.add_argument("--plain", action="store_true", help="no escape codes, whatever TERM says")
    parser.add_argument(
        "--every",
        metavar="S",
        type=_every,
        help=f"seconds between screens (default {EVERY_S:g}; without escape codes {PLAIN_EVERY_S:g})",
    )
    parser.add_argument("--shell", metavar="COMMAND", default="", help="program that key s starts (default: none)")
    parser.add_argument("--notes", metavar="FILE", default="", help="show the lines of this file first")
    parser.add_argument("--stay", action="store_true", help="no key ends it")
    add_socket(parser)


def main(arguments: argparse.Namespace) -> int:
    """Show the console until it ends. Raises UsageError for a --shell with an unclosed quote."""
    control = [arguments.control] if arguments.control else default_paths(FIRST_PORT)
    loop = Loop()
    if arguments.once:
        text, is_answered = once(loop, control, arguments.notes, COLUMNS - 1)
        sys.stdout.write(text)
        return 0 if is_answered else 1
    is_plain = arguments.plain or os.environ.get("TERM", "dumb") in ("", "dumb")
    options = Options(
        control,
        arguments.notes,
        _words(arguments.shell),
        is_plain,
        arguments.every or (PLAIN_EVERY_S if is_plain else EVERY_S),
        arguments.stay,
    )
    console = Console(loop, sys.stdin.fileno(), options)
    try:
        console.start()
        loop.run()
    finally:
        console.close()
    return console.status


def _every(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not LEAST_S <= value <= MOST_S:
        raise argparse.ArgumentTypeError(f"{text!r}: out of range; {LEAST_S:g} to {MOST_S:g} seconds")
    return value


def _words(command: str) -> list[str]:
    try:
        return shlex.split(command)
    except ValueError as error:
        raise UsageError(f"--shell: {command!r}: {error}", "quote it as for a shell") from error
