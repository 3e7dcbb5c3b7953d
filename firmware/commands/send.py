"""captain send: give PDUs to a station and say what became of each."""

import argparse
import io
import os
import sys
import time
from collections.abc import Iterable
from typing import TYPE_CHECKING

from firmware.user import client, payload, sending
from firmware.user.account import Account
from firmware.user.arguments import HIGHEST_RATE, add_station, address, finite, integer, number, seconds, times
from firmware.user.payload import Payload

if TYPE_CHECKING:
    from rich.progress import Progress as RichProgress

DESCRIPTION = """\
Sends facilities PDUs (ITS PDU header first, no BTP) to the station's PULL
socket, where nothing is lost, and waits for its confirms: by which interface
each was sent, how long it was queued, or why it was not.

WHAT is a PDU as hexadecimal digits, a file, a folder of such files, or - for
standard input. Files hold
  .hex .txt  PDUs in hexadecimal, one a line; # begins a remark
  .b64       PDUs in base64, one a line
  .bin       the octets of one PDU
  .json      objects like {"type": "cam", "hex": "0202..."}, in a list or one
             a line, as `captain listen --json` prints them
and standard input holds hexadecimal or JSON lines, unless --format says. An
invalid message is reported with its line and left out; the others are sent.
"""
EPILOG = """\
examples:
  captain send 020200000539000102030405
        a CAM of station 1337, classified by its header
  captain send cam.hex --rate 10 --count 600
        10 a second for a minute
  captain send vectors/ --interface g5
        each PDU of a folder, by one interface
  captain send denm.bin --area circle:48.7668,11.4321,500 --lifetime 2
        a GeoBroadcast into a circle of 500 m
  captain send --format base64 AgIAAAU5AAECAw==
        base64 in place of hexadecimal
  captain listen --json | captain send - --station 127.0.0.1:5565
        what one station receives, another one sends

exit codes:
  0    every message was sent by at least one interface (with --no-confirm:
       was given to the station)
  1    a message was invalid or not sent, or no station answers
  2    wrong usage
  130  Ctrl-C
"""
DEFAULT_RATE = 10.0  # the highest rate of CAMs of one station (EN 302 637-2 clause 6.1.3, T_GenCamMin)
LONGEST_LIFETIME_S = 86400.0  # of the station's options
TOLD_ONE_BY_ONE = 20  # messages; of more only three of each kind that were not sent
LINGER_MS = 2000  # what the socket still holds at the end of --no-confirm


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("what", metavar="WHAT", nargs="+", help="hexadecimal digits, a file, a folder, or -")
    parser.add_argument("--format", choices=payload.FORMATS, help="how to read WHAT, whatever its name says")
    parser.add_argument(
        "--type", metavar="T", type=_type, help="send as this type (cam, denm, ...) without a look at the PDU"
    )
    parser.add_argument("--count", metavar="N", type=times, default=1, help="send all so many times")
    pace = parser.add_mutually_exclusive_group()
    pace.add_argument(
        "--rate",
        metavar="R",
        type=number("messages a second", HIGHEST_RATE, is_zero_allowed=True),
        help="messages per second (default 10); 0: as fast as confirms come back",
    )
    pace.add_argument("--interval", metavar="S", type=seconds, help="seconds between two messages")
    wish = parser.add_argument_group("what the station shall do with them")
    wish.add_argument("--interface", metavar="I", action="append", help="only by this interface; may be repeated")
    wish.add_argument("--label", metavar="L", help="name in confirms, where each message adds /NUMBER")
    wish.add_argument(
        "--area",
        metavar="SHAPE:LAT,LON,A[,B[,ANGLE]]",
        type=area,
        help="a GeoBroadcast into a circle, rectangle or ellipse: degrees, metres, degrees from north",
    )
    wish.add_argument(
        "--lifetime", metavar="S", type=number("seconds", LONGEST_LIFETIME_S), help="not sent when older than this"
    )
    wish.add_argument("--traffic-class", metavar="0..255", type=integer(0, 255))
    wish.add_argument("--priority", metavar="0..7", type=integer(0, 7), help="0 leaves its queue first")
    wish.add_argument("--btp-port", metavar="PORT", type=integer(0, 65535), help="in place of the type's own")
    wish.add_argument("--hop-limit", metavar="1..255", type=integer(1, 255), help="of a GeoBroadcast")
    answers = parser.add_argument_group("answers")
    answers.add_argument("--no-confirm", action="store_true", help="do not wait for what becomes of them")
    answers.add_argument(
        "--wait",
        metavar="S",
        type=seconds,
        default=client.ANSWER_S,
        help="how long to wait for confirms after the last message (default 3)",
    )
    answers.add_argument("--json", action="store_true", help="one JSON object a line for each message")
    add_station(parser)


def main(arguments: argparse.Namespace) -> int:
    place = address(arguments)
    account = Account(arguments.json)
    standard_input = io.BytesIO() if sys.stdin is None else sys.stdin.buffer
    payloads: Iterable[Payload] = account.valid(payload.read(arguments.what, arguments.format, standard_input))
    total = None
    if "-" not in arguments.what or arguments.count > 1:  # else it may never end
        with account.failures:
            payloads = list(payloads)
        total = len(payloads) * arguments.count
        account.is_brief = total > TOLD_ONE_BY_ONE
    if total == 0:
        return 1
    with client.session() as context:
        confirms = None if arguments.no_confirm else sending.confirms(context, place)
        pusher = client.push(context, place)
        outgoing = sending.Sending(
            pusher,
            confirms,
            label=_label(arguments.label),
            options=wishes(arguments),
            interval=interval(arguments),
            on_over=account.one,
        )
        try:
            with Progress(total) as progress, account.failures:
                for _ in range(arguments.count):
                    for count in outgoing.send(payloads, arguments.type):
                        progress.show(count)
                outgoing.wait(arguments.wait)
        finally:
            if confirms is not None:
                outgoing.give_up()
            account.all(outgoing)
        pusher.close(linger=LINGER_MS)
    return 0 if outgoing.all_sent and not account.invalid else 1


# -- what the options mean


def wishes(arguments: argparse.Namespace) -> dict[str, object]:
    """The options object of a message to PULL, without the label."""
    asked = {
        "interfaces": arguments.interface,
        "area": arguments.area,
        "lifetime_s": arguments.lifetime,
        "traffic_class": arguments.traffic_class,
        "priority": arguments.priority,
        "btp_port": arguments.btp_port,
        "hop_limit": arguments.hop_limit,
    }
    return {key: value for key, value in asked.items() if value is not None}


def interval(arguments: argparse.Namespace) -> float:
    """Seconds between two messages; 0 for no pace."""
    if arguments.interval is not None:
        return float(arguments.interval)
    rate = DEFAULT_RATE if arguments.rate is None else arguments.rate
    return 1.0 / rate if rate else 0.0


def _label(asked: str | None) -> str:
    """Confirms go to everybody who subscribes to them: the label tells ours from those of others."""
    return asked or f"captain-send-{os.getpid()}-{time.time_ns():x}"


# Of an area, in the order of writing: key, least, most. EN 302 931, and RawRxMessage for the distances.
AREA = (
    ("latitude", -90.0, 90.0),
    ("longitude", -180.0, 180.0),
    ("distance_a", 0, 65535),
    ("distance_b", 0, 65535),
    ("angle", 0, 360),
)
SHAPES = {"circle": (3, 3), "rectangle": (4, 5), "ellipse": (4, 5)}  # how many of them


def area(text: str) -> dict[str, object]:
    """`circle:LAT,LON,RADIUS`, `rectangle:LAT,LON,A,B[,ANGLE]` or `ellipse:...` as the options have it."""
    shape, _, rest = text.partition(":")
    least, most = SHAPES.get(shape, (0, -1))
    parts = rest.split(",")
    if not least <= len(parts) <= most:
        raise argparse.ArgumentTypeError(
            f"{text!r} is no area; write circle:LAT,LON,RADIUS or rectangle:LAT,LON,A,B,ANGLE or ellipse:..."
        )
    found: dict[str, object] = {"shape": shape}
    for (key, low, high), part in zip(AREA, parts, strict=False):
        value = finite(part)
        if value is None or not low <= value <= high:
            raise argparse.ArgumentTypeError(f"{part!r} is no {key} of {low:g} ... {high:g}")
        found[key] = round(value) if isinstance(low, int) else value
    return found


def _type(text: str) -> str:
    if not payload.TYPE.fullmatch(text.lower()):
        raise argparse.ArgumentTypeError(f"{text!r} is no name of a type: letters, digits and _")
    return text.lower()


class Progress:
    """A progress bar where a person looks at it, nothing elsewhere."""

    def __init__(self, total: int | None) -> None:
        self._total = total
        self._bar: RichProgress | None = None

    def __enter__(self) -> "Progress":
        # One message is gone before a bar is drawn; what goes to a file needs none.
        if self._total != 1 and sys.stdout.isatty() and sys.stderr.isatty():
            from rich.console import Console
            from rich.progress import BarColumn, MofNCompleteColumn, TimeRemainingColumn
            from rich.progress import Progress as RichProgress

            columns = ("sending", BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
            self._bar = RichProgress(*columns, console=Console(), transient=True)
            self._task = self._bar.add_task("", total=self._total)
            self._bar.start()
        return self

    def __exit__(self, *error: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def show(self, count: int) -> None:
        if self._bar is not None:
            self._bar.update(self._task, completed=count)
