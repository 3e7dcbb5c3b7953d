"""Command line: runs one command, reports its failure, returns its exit status."""

import errno
import io
import os
import resource
import sys
from contextlib import redirect_stderr, redirect_stdout
from importlib import import_module
from itertools import zip_longest
from types import ModuleType
from typing import TextIO

from board.runtime.errors import StationError, UsageError
from firmware import VERSION
from firmware.printable import failure, folded
from firmware.usage import USAGE_ERROR, Parser, print_json

# Commands by group, with their summaries. Each command is a module of firmware/commands. `captain --help` imports none
# of these modules, so it takes a tenth of a second instead of a second. It shows two commands per line, so that all fit
# into 24 lines of 80 columns.
GROUPS = {
    "use": {
        "demo": "two simulated stations",
        "run": "run the station",
        "status": "interfaces, queues, drops",
        "listen": "received messages, live",
        "send": "send messages",
        "record": "record for Wireshark, ROS 2",
        "replay": "send recordings again",
        "doctor": "find mistakes and remedies",
        "console": "status on a serial line",
        "update": "install another version",
    },
    "hardware": {
        "board": "rails, temperatures, start",
        "slot": "list slots, switch power",
        "gnss": "receivers: fix, accuracy",
        "modem": "cellular modem",
        "time": "station time and accuracy",
        "selftest": "test each part of the board",
        "box": "set up, check files",
    },
    "tools": {
        "decode": "octets to fields",
        "encode": "fields to octets",
        "convert": "messages to another format",
        "explain": "a message bit by bit",
        "extcap": "live capture in Wireshark",
        "v2n-tap": "a fleet's messages (broker)",
        "ros2": "gateway to ROS 2",
    },
    "develop": {
        "meter": "loss, delay and age",
        "lab": "test between two stations",
        "swarm": "many virtual stations",
        "impair": "emulate a lossy link",
    },
}
VERBS = {verb: summary for group in GROUPS.values() for verb, summary in group.items()}
COLUMN = 39  # width of each of two columns; with a space, a line has 79 characters: some terminals break lines of 80
OUTPUT_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
USAGE = "captain COMMAND [OPTIONS]"
NO_DESCRIPTOR = (errno.EMFILE, errno.ENFILE)
ENOUGH = "run `ulimit -n 1024` in this shell first, or set LimitNOFILE=1024 in the unit"
# Commands whose exit status is the result of all their checks. They continue even after the reader of their output has
# closed the pipe.
JUDGES = frozenset({"doctor", "selftest", "lab"})
INTERRUPTED = 130  # exit status by which shells report SIGINT
CUT_OFF = 141  # exit status by which shells report SIGPIPE


def load(verb: str) -> ModuleType:
    """Import the module of a command: its name with `_` for each hyphen. The frozen binary contains all of them."""
    return import_module(f"firmware.commands.{verb.replace('-', '_')}")


def main(argv: list[str]) -> int:
    """Run one command and return the exit status.

    0: success; 1: failure; 2: usage error; 130: interrupted; 141: the reader of the output closed the pipe.
    """
    # Python sets a standard stream to None if the caller has closed it. Its output is discarded.
    sys.stdout = sys.stdout or open(os.devnull, "w")  # noqa: SIM115 open until the process ends
    sys.stderr = sys.stderr or open(os.devnull, "w")  # noqa: SIM115
    status = CUT_OFF
    try:
        try:
            return (status := _run(argv) if argv and argv[0] in VERBS else _help(argv))
        except SystemExit as ended:  # argparse raises it after help or a usage error
            status = int(ended.code or 0)
            raise
        finally:
            sys.stdout.flush()  # here, because an error of Python's own flush at exit cannot be caught
    except BrokenPipeError:
        for stream in (sys.stdout, sys.stderr):
            _mute(stream)
        return status  # the command itself is complete; only the rest of its output was not read
    except OSError as error:
        if error.errno not in OUTPUT_FULL:
            raise
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        print(f"captain: cannot write: {error.strerror}", file=sys.stderr)
        return 1


def _run(argv: list[str]) -> int:
    for stream in (sys.stdout, sys.stderr):
        # Characters that the terminal's encoding does not have are escaped instead of raising UnicodeEncodeError.
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    command = load(argv[0])
    Parser.is_json = "--json" in argv
    parser = Parser(prog=f"captain {argv[0]}", description=command.DESCRIPTION, epilog=command.EPILOG)
    command.arguments(parser)
    with redirect_stdout(_Unheard(sys.stdout)), redirect_stderr(_Unheard(sys.stderr)):
        options = parser.parse_args(argv[1:])
    try:
        if argv[0] in JUDGES and not sys.stdout.isatty():
            with redirect_stdout(_Unheard(sys.stdout)):
                return int(command.main(options))
        return int(command.main(options))
    except StationError as error:
        _tell(error, getattr(options, "json", False))
        return USAGE_ERROR if isinstance(error, UsageError) else 1
    except KeyboardInterrupt:
        return INTERRUPTED
    except Exception as error:  # OSError and zmq.ZMQError have an errno
        if getattr(error, "errno", None) not in NO_DESCRIPTOR:
            raise
        most = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
        told = StationError(f"out of file descriptors: the limit of this process is {most}", ENOUGH)
        _tell(told, getattr(options, "json", False))
        return 1


class _Unheard(io.TextIOBase):
    """Stream that discards output after its reader has closed the pipe."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        try:
            return self._stream.write(text)
        except BrokenPipeError:
            _mute(self._stream)
            return len(text)

    def flush(self) -> None:
        _mute(self._stream)

    def close(self) -> None:
        """Leave the stream open: Python closes this object when it is deleted, and errors could not be caught then."""

    def isatty(self) -> bool:
        return self._stream.isatty()

    def fileno(self) -> int:
        return self._stream.fileno()


def _mute(stream: TextIO) -> None:
    """Flush a stream. If its reader has closed the pipe, discard this and all later output."""
    try:
        stream.flush()
    except BrokenPipeError:
        os.dup2(nowhere := os.open(os.devnull, os.O_WRONLY), stream.fileno())
        os.close(nowhere)


def _tell(error: StationError, is_json: bool) -> None:
    """Print an error on standard error; with --json, print it as a JSON object on standard output as well."""
    try:
        print(folded(f"captain: {failure(error)}", sys.stderr), file=sys.stderr, flush=True)
        if is_json:
            print_json(error)
    except BrokenPipeError:
        _mute(sys.stderr)
        _mute(sys.stdout)


def _help(argv: list[str]) -> int:
    if argv and argv[0] in ("--version", "-V"):
        print(f"captain {VERSION}")
        return 0
    is_asked = bool(argv) and argv[0] in ("--help", "-h", "help")
    if is_asked and len(argv) > 1 and argv[1] in VERBS:
        return _run([argv[1], "--help"])
    out = _Unheard(sys.stdout if is_asked else sys.stderr)
    if is_asked or not argv:
        print("\n".join(_commands()), file=out)
        return 0 if is_asked else USAGE_ERROR
    is_option = argv[0].startswith("-")
    from board.runtime.describe import did_you_mean

    close = did_you_mean(argv[0], ("--help", "--version") if is_option else VERBS)
    print(f"usage: {USAGE}" if close else "\n".join(_commands()[:-1]), file=out)
    remedy = close or "`captain --help` shows all"
    print(f"captain: unknown {'option' if is_option else 'command'}: {argv[0]!r}; {remedy}", file=out)
    return USAGE_ERROR


def _commands() -> list[str]:
    """Return the lines of `captain --help`."""
    lines = [f"usage: {USAGE}", ""]
    width = max(map(len, VERBS))
    for group, verbs in GROUPS.items():
        cells = [f"  {verb:{width}}  {summary}" for verb, summary in verbs.items()]
        pairs = zip_longest(cells[::2], cells[1::2], fillvalue="")
        lines += [f"{group}:", *(f"{left:{COLUMN}} {right}".rstrip() for left, right in pairs)]
    return [*lines, "", "captain COMMAND --help shows options and examples; captain --version"]
