"""Arguments and message loop of decode, encode, convert and explain."""

import argparse
import io
import json
import sys
from collections import Counter
from collections.abc import Callable

from board.errors import RequestError
from firmware.codec.decoding import error_record
from firmware.codec.reading import FORMS, Object, Pdu, Reader
from firmware.printable import clean
from firmware.user.failures import Failures

FORMS_HELP = """\
WHAT is a file, a folder of files, or the message itself; - or nothing is
standard input. Read are
  hexadecimal   a message a line; blanks and colons as they please, # a remark
  base64        a message a line
  binary        the octets of one message
  JSON          objects with `hex` or `base64`, as `captain listen --json` has
  captures      pcap and pcapng: Ethernet, 802.11, radiotap, Linux cooked, and
                Ethernet frames inside UDP; GeoNetworking packets, whose
                signatures are not verified
  MCAP          of `captain record` and of the gateway to ROS 2
captain detects the format; --from overrides it. The input may also be a whole
frame with GeoNetworking: Ethernet, 802.11, radiotap, Linux cooked. captain
identifies SAE J2735 messages and XML (XER) but does not decode them.
"""


def add_input(parser: argparse.ArgumentParser) -> None:
    """Add WHAT and its format; each() uses them."""
    parser.add_argument("what", metavar="WHAT", nargs="*", help="a file, a folder, the message itself, or -")
    parser.add_argument("--from", dest="form", choices=FORMS, help="format of WHAT (default: detected)")


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

    is_json   each failure is an object on standard output.
    failures  that `do` reports to as well, with warnings; None: it reports nothing.
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
                    told.tell(error)
    _tell_skipped(source.skipped)
    return 1 if failed or not count else 0


def _reader(arguments: argparse.Namespace) -> Reader:
    if sys.stdin is None:  # closed by the caller
        return Reader(arguments.form, io.BytesIO())
    if "-" in (arguments.what or ["-"]) and sys.stdin.isatty():
        print("captain: reads standard input until Ctrl-D", file=sys.stderr)
    return Reader(arguments.form, sys.stdin.buffer)


def _tell_skipped(skipped: Counter[str]) -> None:
    """Report the frames of captures that hold no message."""
    if skipped:
        each = ", ".join(f"{count} {what}" for what, count in sorted(skipped.items()))
        print(f"captain: without a message: {clean(each)}", file=sys.stderr)


def print_json(value: dict[str, object]) -> None:
    print(json.dumps(value), flush=True)
