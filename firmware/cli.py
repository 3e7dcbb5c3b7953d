"""The command line: one verb, its arguments, and how failures are told."""

import argparse
import errno
import io
import os
import re
import resource
import sys
from contextlib import redirect_stderr, redirect_stdout
from types import ModuleType
from typing import TextIO

from board.errors import StationError, UsageError
from firmware import VERSION
from firmware.printable import failure

# What `captain --help` says, without importing what it speaks of: a start is a tenth of a second, not a whole one.
VERBS = {
    "run": "run the station in the foreground",
    "status": "what a running station does: interfaces, queues, counters, drops with their reasons",
    "console": "the status screen of a serial console: 80 columns, 24 lines, a key for a shell",
    "listen": "live table of received messages with their fields, or one JSON object a line",
    "record": "frames as they come and go, for Wireshark; messages for ROS 2; a ring that keeps what was",
    "replay": "recordings and captures sent again, into a station or on a link; rewritten, through a bad way",
    "impair": "a bad way between two interfaces: loss, bursts, delay, reordering, copies, wrong bits; all counted",
    "swarm": "many virtual stations that drive and send CAMs by the rules, CPMs and DENMs: up to and past a channel",
    "extcap": "what Wireshark calls to capture from a station as from a network device",
    "send": "send messages from hex, base64, files or directories, and say what became of each",
    "decode": "octets of messages to their fields, from hex, base64, files or captures",
    "encode": "fields to octets: the inverse of decode --json",
    "convert": "messages from one form into another: hex, base64, binary, JSON, pcap",
    "explain": "a message bit by bit, or why it does not decode",
    "v2n-tap": "what a fleet publishes at an MQTT broker: shown and recorded, in as many copies as one likes",
    "slot": "what sits in the board's slots, and their power: list, on, off, cycle",
    "board": "the board: identity, slots, rails, temperatures, and the time line of the start",
    "gnss": "what the GNSS receivers see: fix, accuracy, jamming, leap seconds; and their reset",
    "time": "what time it is, by whose word, how exact; offset, jitter and Allan deviation as a picture",
    "modem": "what the cellular modem sees; a command to it; its reset",
    "selftest": "each thing that the board declares: is it there, does it work, what does it measure",
    "update": "another version for the box: from a file or an address; the slots; back to the one before",
    "box": "the owner's files of a card: whether a box will take them",
    "ros2": "the gateway to ROS 2, by the Python of the ROS that is sourced",
    "meter": "loss, delay, order and age of messages between stations, live or of recordings; as a page",
    "doctor": "check configuration, ports, interfaces, permissions and clock, and say what to do",
    "demo": "two simulated stations that exchange messages, watched live",
    "lab": "the ten-message test between two stations: sent, received, equal, lost",
}
USAGE_ERROR = 2
OUTPUT_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
NO_DESCRIPTOR = (errno.EMFILE, errno.ENFILE)
ENOUGH = "run `ulimit -n 1024` in this shell first, or set LimitNOFILE=1024 in the unit"
# Their exit status is a verdict over all that they look at: they go on though nobody reads what they say.
JUDGES = frozenset({"doctor", "selftest", "lab"})
# What begins like a negative number is a value, and no option: argparse knows whole values only, and not "-20.5,100".
A_NUMBER = re.compile(r"-\.?\d")
INTERRUPTED = 130  # as a shell reports SIGINT
CUT_OFF = 141  # as a shell reports SIGPIPE


def load(verb: str) -> ModuleType:  # noqa: PLR0915 (a table)
    """The module of a verb; imported here by name so that tools and the freezer find each."""
    match verb:
        case "run":
            from firmware.commands import run

            return run
        case "status":
            from firmware.commands import status

            return status
        case "console":
            from firmware.commands import console

            return console
        case "listen":
            from firmware.commands import listen

            return listen
        case "record":
            from firmware.commands import record

            return record
        case "replay":
            from firmware.commands import replay

            return replay
        case "impair":
            from firmware.commands import impair

            return impair
        case "swarm":
            from firmware.commands import swarm

            return swarm
        case "extcap":
            from firmware.commands import extcap

            return extcap
        case "send":
            from firmware.commands import send

            return send
        case "decode":
            from firmware.commands import decode

            return decode
        case "encode":
            from firmware.commands import encode

            return encode
        case "convert":
            from firmware.commands import convert

            return convert
        case "explain":
            from firmware.commands import explain

            return explain
        case "v2n-tap":
            from firmware.commands import v2n_tap

            return v2n_tap
        case "slot":
            from firmware.commands import slot

            return slot
        case "board":
            from firmware.commands import board

            return board
        case "gnss":
            from firmware.commands import gnss

            return gnss
        case "time":
            from firmware.commands import time

            return time
        case "modem":
            from firmware.commands import modem

            return modem
        case "selftest":
            from firmware.commands import selftest

            return selftest
        case "update":
            from firmware.commands import update

            return update
        case "box":
            from firmware.commands import box

            return box
        case "ros2":
            from firmware.commands import ros2

            return ros2
        case "meter":
            from firmware.commands import meter

            return meter
        case "doctor":
            from firmware.commands import doctor

            return doctor
        case "demo":
            from firmware.commands import demo

            return demo
        case _:
            from firmware.commands import lab

            return lab


def main(argv: list[str]) -> int:
    """Run one verb. Returns the exit status: 0 done, 1 failed, 2 wrong usage, 130 interrupted, 141 its reader left."""
    # A stream that the caller has closed is None: what would be said to it is said to nobody.
    sys.stdout = sys.stdout or open(os.devnull, "w")  # noqa: SIM115 for as long as the process runs
    sys.stderr = sys.stderr or open(os.devnull, "w")  # noqa: SIM115
    status = CUT_OFF
    try:
        try:
            return (status := _run(argv) if argv and argv[0] in VERBS else _help(argv))
        except SystemExit as ended:  # of argparse, which has told how to use it, or that it was used wrongly
            status = int(ended.code or 0)
            raise
        finally:
            sys.stdout.flush()  # at exit it would be too late to say nothing
    except BrokenPipeError:
        for stream in (sys.stdout, sys.stderr):
            _mute(stream)
        return status  # what was done is done, though nobody reads that it was
    except OSError as error:
        if error.errno not in OUTPUT_FULL:
            raise
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        print(f"captain: cannot write: {error.strerror}", file=sys.stderr)
        return 1


def _run(argv: list[str]) -> int:
    for stream in (sys.stdout, sys.stderr):
        # A name that the terminal's character set lacks is shown as an escape, not as a traceback.
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    command = load(argv[0])
    parser = argparse.ArgumentParser(
        prog=f"captain {argv[0]}",
        description=command.DESCRIPTION,
        epilog=command.EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser._negative_number_matcher = A_NUMBER
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
    except Exception as error:  # OSError, and that of ZeroMQ
        if getattr(error, "errno", None) not in NO_DESCRIPTOR:
            raise
        most = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
        told = StationError(f"out of file descriptors: the limit of this process is {most}", ENOUGH)
        _tell(told, getattr(options, "json", False))
        return 1


class _Unheard(io.TextIOBase):
    """A stream that is written to as before when its reader has left."""

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
        """Leave the stream open: at its end this object would flush it, where no error can be reported."""

    def isatty(self) -> bool:
        return self._stream.isatty()

    def fileno(self) -> int:
        return self._stream.fileno()


def _mute(stream: TextIO) -> None:
    """Write what waits; where the reader has left nobody reads that, nor what follows, nor what is left at exit."""
    try:
        stream.flush()
    except BrokenPipeError:
        os.dup2(nowhere := os.open(os.devnull, os.O_WRONLY), stream.fileno())
        os.close(nowhere)


def _tell(error: StationError, is_json: bool) -> None:
    """What went wrong, for people; a program that asked for JSON has it as an object too, where it reads the rest."""
    try:
        print(f"captain: {failure(error)}", file=sys.stderr, flush=True)
        if is_json:
            import json

            print(json.dumps({"error": error.message, "hint": error.hint}), flush=True)
    except BrokenPipeError:
        _mute(sys.stderr)
        _mute(sys.stdout)


def _help(argv: list[str]) -> int:
    if argv and argv[0] in ("--version", "-V"):
        print(f"captain {VERSION}")
        return 0
    is_asked = bool(argv) and argv[0] in ("--help", "-h", "help")
    out = _Unheard(sys.stdout if is_asked else sys.stderr)
    if argv and not is_asked:
        print(f"captain: {argv[0]!r} is no command", file=out)
    print("usage: captain COMMAND [OPTIONS]\n\nStation software of a V2X box.\n\ncommands:", file=out)
    for verb, summary in VERBS.items():
        print(f"  {verb:8} {summary}", file=out)
    print("\ncaptain COMMAND --help tells more; captain --version", file=out)
    return 0 if is_asked else USAGE_ERROR
