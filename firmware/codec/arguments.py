"""Arguments and message loop of decode, encode, convert and explain."""

import argparse
import io
import json
import sys
from collections import Counter
from collections.abc import Callable

from board.runtime.errors import RequestError
from firmware.client.show.failures import Failures
from firmware.codec.decoding import error_record
from firmware.codec.reading import FORMS, Object, Pdu, Reader
from firmware.printable import clean

FORMS_HELP = """\
The argument WHAT is a file, a folder of files, or the message itself. Without
it, or with -, the command reads standard input.

Formats, which captain detects unless --format is given:
  hexadecimal   one message per line; optional blanks and colons, # a comment
  base64        one message per line
  binary        one message
  JSON          objects with `hex` or `base64`, as of `captain listen --json`
  captures      pcap and pcapng: Ethernet, 802.11, radiotap, Linux cooked, and
                Ethernet frames inside UDP. Signatures are not verified.
  MCAP          files of `captain record` and of the gateway to ROS 2

A message may also be a whole frame with GeoNetworking. captain identifies SAE
J2735 messages and XML (XER), but does not decode them.
"""


def add_input(parser: argparse.ArgumentParser) -> None:
    """Add WHAT and its format; each() uses them."""
    parser.add_argument("what", metavar="WHAT", nargs="*", help="a file, a folder, the message itself, or -")
    add_format(parser)
    # Former name of --format, still accepted.
    parser.add_argument("--from", dest="form", choices=FORMS, default=argparse.SUPPRESS, help=argparse.SUPPRESS)


def add_format(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--format", dest="form", choices=FORMS, help="format of WHAT (default: detected)")
    # Its former name.
    parser.add_argument("--form", choices=FORMS, default=argparse.SUPPRESS, help=argparse.SUPPRESS)


def add_edition(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--edition",
        metavar="E",
        help="edition (cam-1.4.1) or type (cam) of the input; list: `captain decode --list`",
    )
    parser.add_argument(
        "--force", action="store_true", help="use --edition even if the header announces another edition (tests)"
    )


def each(
    arguments: argparse.Namespace,
    do: Callable[[Pdu | Object], None],
    is_json: bool = False,
    failures: Failures | None = None,
) -> int:
    """Call `do` for each message of WHAT; report failures and continue. Returns the exit status.

    is_json   print each failure as a JSON object on standard output.
    failures  report that `do` also adds warnings to; None: a new one.
    """
    source = _reader(arguments)
    failed = count = 0
    with failures or Failures() as told:
        for item in source.read(arguments.what or ["-"]):
            count += 1
            try:
                if isinstance(item, RequestError):
                    raise item
                do(item)
            except RequestError as error:
                failed += 1
                if is_json:
                    print_json(error_record(error))
                else:
                    told.report(error)
    _tell_skipped(source.skipped)
    return 1 if failed or not count else 0


def _reader(arguments: argparse.Namespace) -> Reader:
    if sys.stdin is None:  # closed by the caller
        return Reader(arguments.form, io.BytesIO())
    if "-" in (arguments.what or ["-"]) and sys.stdin.isatty():
        print("captain: reads standard input until Ctrl-D", file=sys.stderr)
    return Reader(arguments.form, sys.stdin.buffer)


def _tell_skipped(skipped: Counter[str]) -> None:
    """Print how many frames of captures contained no message, by kind."""
    if skipped:
        each = ", ".join(f"{count} {what}" for what, count in sorted(skipped.items()))
        print(f"captain: without a message: {clean(each)}", file=sys.stderr)


def print_json(value: dict[str, object]) -> None:
    print(json.dumps(value), flush=True)
