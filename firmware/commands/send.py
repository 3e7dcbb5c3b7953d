"""captain send: sends PDUs through a station and prints the outcome of each."""

import argparse
import io
import os
import sys
import time
from collections.abc import Iterable
from typing import TYPE_CHECKING

from firmware.client import client
from firmware.client.arguments import HIGHEST_RATE, add_station, address, finite, integer, number, seconds, times
from firmware.client.sending import payload, sending
from firmware.client.sending.account import Account
from firmware.client.sending.payload import Payload

if TYPE_CHECKING:
    from rich.progress import Progress as RichProgress
    from rich.progress import TaskID

DESCRIPTION = """\
Sends messages to the PULL port of a station. For each message it prints by
which interface it was sent, how long it was queued, or why it was dropped.

The argument WHAT is a PDU as hexadecimal digits, a JSON object, a file, a
folder of files, or - for standard input. Files contain, by their name:
  .hex .txt  PDUs in hexadecimal, one per line; # begins a comment
  .b64       PDUs in base64, one per line
  .bin       one PDU
  .json      objects of `captain listen --json` or `captain decode --json`,
             one per line or in a list

An object {"edition": "cam-1.4.1", "message": {...}} is encoded by the station.
It fills in a missing header, time and position.

Standard input contains hexadecimal or JSON lines, unless --format is given.
An invalid message is reported with its line; the others are sent.
"""
EPILOG = """\
examples:
  captain send 020200000539000102030405
        a CAM of station 1337, classified by its header
  captain send cam.hex --rate 10 --count 600
        10 per second for a minute
  captain send vectors/ --interface g5
        all PDUs of a folder, by one interface
  captain send denm.bin --area circle:48.7668,11.4321,500 --lifetime 2
        a GeoBroadcast into a circle of 500 m
  captain send --format base64 AgIAAAU5AAECAw==
        a CAM in base64
  captain decode --json 0202... | jq '.message.header.stationID = 7' | captain send -
        the same CAM of another station
  captain listen --json | captain send - --station 127.0.0.1:5565
        forward from one station to another

exit codes:
  0    every message was sent by at least one interface; with --no-confirm:
       every message was given to the station
  1    a message was invalid or not sent, or no station answers
  2    wrong usage
  130  Ctrl-C
"""
DEFAULT_RATE = 10.0  # the highest rate of CAMs of one station (EN 302 637-2 clause 6.1.3, T_GenCamMin)
LONGEST_LIFETIME_S = 86400.0  # limit of the station for lifetime_s
TOLD_ONE_BY_ONE = 20  # messages; above this, at most three unsent ones of each kind are reported
LINGER_MS = 2000  # time in ms for unsent messages at the end of --no-confirm


def arguments(parser: argparse.ArgumentParser) -> None:
    what = "hexadecimal digits, a JSON object, a file, a folder, or -"
    parser.add_argument("what", metavar="WHAT", nargs="+", help=what)
    parser.add_argument("--format", choices=payload.FORMATS, help="format of WHAT (default: by its name)")
    parser.add_argument(
        "--type", metavar="T", type=_type, help="type of all messages (cam, denm, ...); default: by messageID"
    )
    parser.add_argument("--count", metavar="N", type=times, default=1, help="send all messages N times")
    pace = parser.add_mutually_exclusive_group()
    pace.add_argument(
        "--rate",
        metavar="R",
        type=number("messages per second", HIGHEST_RATE, is_zero_allowed=True),
        help="messages per second (default 10); 0: as fast as confirms come back",
    )
    pace.add_argument("--interval", metavar="S", type=seconds, help="seconds between two messages")
    wish = parser.add_argument_group("options of the messages")
    wish.add_argument("--interface", metavar="I", action="append", help="send by this interface only; may be repeated")
    wish.add_argument("--plain", action="store_true", help="numbers in JSON are in SI units and degrees")
    wish.add_argument("--label", metavar="L", help="label in confirms; /NUMBER is added for each message")
    wish.add_argument(
        "--area",
        metavar="SHAPE:LAT,LON,A[,B[,ANGLE]]",
        type=area,
        help="send a GeoBroadcast into a circle, rectangle or ellipse: degrees, metres, degrees from north",
    )
    wish.add_argument(
        "--lifetime",
        metavar="S",
        type=number("seconds", LONGEST_LIFETIME_S),
        help="do not send messages older than this",
    )
    wish.add_argument(
        "--traffic-class", metavar="0..255", type=integer(0, 255), help="traffic class (default: that of the type)"
    )
    wish.add_argument("--priority", metavar="0..7", type=integer(0, 7), help="0 leaves its queue first")
    wish.add_argument("--btp-port", metavar="PORT", type=integer(0, 65535), help="BTP port (default: that of the type)")
    wish.add_argument("--hop-limit", metavar="1..255", type=integer(1, 255), help="hop limit of a GeoBroadcast")
    answers = parser.add_argument_group("answers")
    answers.add_argument("--no-confirm", action="store_true", help="do not wait for confirms")
    answers.add_argument(
        "--wait",
        metavar="S",
        type=seconds,
        default=client.ANSWER_S,
        help="seconds to wait for confirms after the last message (default 3)",
    )
    answers.add_argument("--json", action="store_true", help="one JSON object per message")
    add_station(parser)


def main(arguments: argparse.Namespace) -> int:
    place = address(arguments)
    account = Account(arguments.json)
    standard_input = io.BytesIO() if sys.stdin is None else sys.stdin.buffer
    payloads: Iterable[Payload] = account.valid(payload.read(arguments.what, arguments.format, standard_input))
    if arguments.plain:
        payloads = (one._replace(form="plain") if one.form == "json" else one for one in payloads)
    total = None
    if "-" not in arguments.what or arguments.count > 1:  # standard input may be endless, so it is not read in advance
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
    if outgoing.all_sent and not account.invalid:
        return 0
    print(
        f"captain: not sent: {account.unsent(outgoing)} of {outgoing.count + account.invalid} messages", file=sys.stderr
    )
    return 1


# -- options of messages


def wishes(arguments: argparse.Namespace) -> dict[str, object]:
    """Return the options of a message to PULL, without its label."""
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
    """Return the seconds between two messages; 0 without a pace."""
    if arguments.interval is not None:
        return float(arguments.interval)
    rate = DEFAULT_RATE if arguments.rate is None else arguments.rate
    return 1.0 / rate if rate else 0.0


def _label(asked: str | None) -> str:
    """Return the label that identifies the confirms of this command.

    Each subscriber receives the confirms of all users.
    """
    return asked or f"captain-send-{os.getpid()}-{time.time_ns():x}"


# Numbers of an area in their order: key, least, most. Sources: EN 302 931; for the distances, RawRxMessage.
AREA = (
    ("latitude", -90.0, 90.0),
    ("longitude", -180.0, 180.0),
    ("distance_a", 0, 65535),
    ("distance_b", 0, 65535),
    ("angle", 0, 360),
)
SHAPES = {"circle": (3, 3), "rectangle": (4, 5), "ellipse": (4, 5)}  # least and most count of numbers by shape


def area(text: str) -> dict[str, object]:
    """Parse `circle:LAT,LON,RADIUS`, `rectangle:LAT,LON,A,B[,ANGLE]` or `ellipse:...` into options of a message.

    Raises ArgumentTypeError for another form, and for a number outside its range in AREA.
    """
    shape, _, rest = text.partition(":")
    least, most = SHAPES.get(shape, (0, -1))
    parts = rest.split(",")
    if not least <= len(parts) <= most:
        raise argparse.ArgumentTypeError(
            f"{text!r}: invalid area; write circle:LAT,LON,RADIUS or rectangle:LAT,LON,A,B,ANGLE or ellipse:..."
        )
    found: dict[str, object] = {"shape": shape}
    for (key, low, high), part in zip(AREA, parts, strict=False):
        value = finite(part)
        if value is None or not low <= value <= high:
            raise argparse.ArgumentTypeError(f"{key}: {part!r}: out of range; {low:g} to {high:g}")
        found[key] = round(value) if isinstance(low, int) else value
    return found


def _type(text: str) -> str:
    if not payload.TYPE.fullmatch(text.lower()):
        raise argparse.ArgumentTypeError(f"{text!r} is not a name of a type: letters, digits and _")
    return text.lower()


class Progress:
    """Progress bar on a terminal; nothing elsewhere."""

    def __init__(self, total: int | None) -> None:
        self._total = total
        self._bar: tuple[RichProgress, TaskID] | None = None

    def __enter__(self) -> "Progress":
        # One message is sent before a bar could be drawn, and output to a file needs no bar.
        if self._total != 1 and sys.stdout.isatty() and sys.stderr.isatty() and os.environ.get("TERM") != "dumb":
            from rich.console import Console
            from rich.progress import BarColumn, MofNCompleteColumn, TimeRemainingColumn
            from rich.progress import Progress as RichProgress

            columns = ("sending", BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
            bar = RichProgress(*columns, console=Console(), transient=True)
            self._bar = bar, bar.add_task("", total=self._total)
            bar.start()
        return self

    def __exit__(self, *error: object) -> None:
        if self._bar is not None:
            self._bar[0].stop()

    def show(self, count: int) -> None:
        if self._bar is not None:
            bar, task = self._bar
            bar.update(task, completed=count)
