"""captain console: the status screen of the box's serial console."""

import argparse
import math
import os
import shlex
import sys

from board.errors import UsageError
from board.loop import Loop
from firmware.console.console import EVERY_S, Console, Options, once
from firmware.console.terminal import COLUMNS
from firmware.control_socket import default_paths
from firmware.user.arguments import add_socket

DESCRIPTION = """\
Shows on a terminal of 80 columns and 24 lines, such as one at a serial line of
115200 baud, what a person with a cable wants to know: name, version and time
of the station of this machine, slots, interfaces with why and messages a
second, position, addresses, the last errors; and when no station answers, why
and who starts it. A key turns the page, another opens a shell.

It is plain ASCII. In place it is drawn with nothing but cursor home and erase,
which any VT100 has; where TERM says dumb or nothing, without escape codes, one
screen below the other. What a noisy line types is counted and opens nothing.
"""
EPILOG = """\
examples:
  captain console
  captain console --once                        one screen, for scripts
  captain console --shell '/bin/bash --login' --stay --notes /run/captain/notes
                                                as a service on a serial line
  captain console --plain --every 60            a line printer, or a log

exit codes:
  0    somebody left by q, the terminal has hung up, or SIGTERM
  1    there is no terminal; with --once: no station answers
  2    wrong usage
  130  Ctrl-C
"""
PLAIN_EVERY_S = 30.0
LEAST_S, MOST_S = 2.0, 3600.0  # a station is asked each 2 s at most
FIRST_PORT = 5555


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--once", action="store_true", help="print all pages once, and end")
    parser.add_argument("--plain", action="store_true", help="no escape codes, whatever TERM says")
    parser.add_argument(
        "--every",
        metavar="S",
        type=_every,
        help=f"seconds between two screens (default {EVERY_S:g}; without escape codes {PLAIN_EVERY_S:g})",
    )
    parser.add_argument("--shell", metavar="COMMAND", default="", help="what the key s starts (default: no such key)")
    parser.add_argument("--notes", metavar="FILE", default="", help="its lines are shown above all others")
    parser.add_argument("--stay", action="store_true", help="no key ends it")
    add_socket(parser)


def main(arguments: argparse.Namespace) -> int:
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
        raise argparse.ArgumentTypeError(f"{text!r} is no number of seconds from {LEAST_S:g} to {MOST_S:g}")
    return value


def _words(command: str) -> list[str]:
    try:
        return shlex.split(command)
    except ValueError as error:
        raise UsageError(f"--shell: {command!r}: {error}", "quote it as a shell would want it") from error
