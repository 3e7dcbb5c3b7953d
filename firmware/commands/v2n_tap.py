"""captain v2n-tap: what a fleet publishes at a broker, taken in as many copies as one likes, shown and recorded."""

import argparse
import json
import time
from collections.abc import Callable
from pathlib import Path

from board.errors import UsageError
from drivers import mqtt_profile
from drivers.wire.v2n import Profile
from firmware.tap import topics
from firmware.tap.arguments import add_broker, settings_of
from firmware.tap.connection import ANSWER_S, Connection
from firmware.tap.counts import Taken
from firmware.tap.display import Display, line
from firmware.tap.recording import Recording, Rotation
from firmware.tap.tap import Tap, Wish, run, say
from firmware.user.arguments import integer, message_type, seconds, times
from firmware.user.table import Screen

DESCRIPTION = """\
Takes what vehicles publish at a broker: shows it as a live table, as lines or
as JSON, and records it. All copies that are started with the same --group share
one subscription: the broker gives each message to one of them, so that
together they take what one alone could not. A copy may come and go: it
unsubscribes first, takes what the broker had sent it already, then ends.

What cannot be read is counted by reason, with the last sample. The sums are
told at the end, on standard error.
"""
EPILOG = """\
examples:
  captain v2n-tap --url mqtts://broker.example --ca ca.pem --certificate me.pem --key me.key
                                            a live table, until Ctrl-C
  captain v2n-tap --url mqtt://localhost --json --duration 60 >minute.jsonl
                                            for programs; decode reads it too
  captain v2n-tap --url mqtt://localhost --record drive.jsonl --max-messages 100000
                                            files of 100,000 messages each,
                                            drive.000001.jsonl and so on;
                                            start it again for a second copy
  captain v2n-tap --url mqtt://localhost --profile orange --tile 120203 --published
                                            what vehicles send from one tile
  captain v2n-tap --url mqtt://localhost --group "" --lines --type denm
                                            every DENM, whoever else takes it

JSON, one object a line, also in files of JSON lines:
  type, station_id, message_id, protocol_version, octets, hex
        of the PDU
  received (Unix time in s), topic, btp_port, source
        of the broker; port and source where topic or payload name them
A pcap holds the messages in GeoNetworking frames; topic and source are lost.

exit codes:
  0    the count or the duration is reached, or SIGTERM
  1    the broker is not there or refuses, or a file cannot be written
  2    wrong usage
  130  Ctrl-C
"""
GROUP = "captain"
LEAST_ANSWER_S = 1.0  # a TLS handshake by a mobile network has three round trips
LEAST_FILE = 4096  # octets: one message with the longest PDU and topic has less, in most profiles


def arguments(parser: argparse.ArgumentParser) -> None:
    how = parser.add_mutually_exclusive_group()
    how.add_argument("--json", action="store_true", help="one JSON object a line for each message")
    how.add_argument("--lines", action="store_true", help="one line for each message")
    how.add_argument("--quiet", action="store_true", help="nothing but the sums at the end")
    what = parser.add_argument_group("what is taken")
    what.add_argument(
        "--group",
        metavar="NAME",
        type=_read(topics.group_name),
        default=GROUP,
        help="of the shared subscription (default %(default)s); empty: every message, whoever else takes it",
    )
    what.add_argument(
        "--filter",
        metavar="F",
        type=_read(topics.own_filter),
        action="append",
        help="in place of the profile's; may be repeated",
    )
    what.add_argument("--tile", metavar="QUADKEY", type=_read(topics.quadkey), help="only this tile")
    what.add_argument(
        "--published",
        action="store_true",
        help="where vehicles publish, in place of where they subscribe, if the profile tells these apart",
    )
    what.add_argument(
        "--type", metavar="T", action="append", type=message_type, default=[], help="only this type; may be repeated"
    )
    what.add_argument("--count", metavar="N", type=times, help="end after so many messages")
    what.add_argument("--duration", metavar="S", type=seconds, help="end after so many seconds")
    files = parser.add_argument_group("recording")
    files.add_argument("--record", metavar="FILE", type=Path, help="into FILE.jsonl or FILE.pcap, which must not exist")
    files.add_argument("--max-octets", metavar="N", type=integer(LEAST_FILE, 2**40), help="then another file")
    files.add_argument("--max-messages", metavar="N", type=times, help="then another file")
    files.add_argument("--keep", metavar="N", type=times, help="so many files of this copy, the oldest goes")
    add_broker(parser)


def main(arguments: argparse.Namespace) -> int:
    wanted = settings_of(arguments)
    profile = mqtt_profile.load(wanted.profile)
    description = topics.tapped(profile, arguments.published, has_all=bool(arguments.filter))
    filters = arguments.filter or topics.filters(description, wanted.prefix, arguments.tile or "")
    qos = description.qos if wanted.qos is None else wanted.qos
    shared = [(topics.shared(arguments.group, text), qos) for text in filters]
    reader = Profile(description, topics.identity(wanted), mqtt_profile.codec(description))
    recording = _recording(arguments)
    wish = Wish(frozenset(map(str, arguments.type)), arguments.count, arguments.duration)
    tap = Tap(reader, wish, recording)
    if arguments.published:
        tap.is_copy = topics.copies(profile, wanted.prefix)
    connection = Connection(wanted, shared, tap.take, say, _answer_s(arguments.duration))
    try:
        return _shown(connection, tap, arguments)
    finally:
        for told in tap.counts.lines(connection.counts) if connection.has_been_up else ():
            say(told)  # below the last table, which would hide it
        if recording is not None:
            recording.close()


def _answer_s(duration: float | None) -> float:
    """How long the broker is waited for: a look of two seconds does not wait ten for one that stalls."""
    return ANSWER_S if duration is None else min(ANSWER_S, max(LEAST_ANSWER_S, duration))


def _shown(connection: Connection, tap: Tap, arguments: argparse.Namespace) -> int:
    if arguments.json or arguments.lines or arguments.quiet:
        if not arguments.quiet:
            form = _json if arguments.json else line
            tap.show = lambda message: print(form(message), flush=True)
        return run(connection, tap, lambda: None)
    with Screen() as screen:
        display = Display(screen, tap.counts, connection)
        tap.show = display.add
        code = run(connection, tap, display.idle)
        display.draw(time.monotonic(), is_last=True)
    return code


def _json(message: Taken) -> str:
    return json.dumps(message.record())


def _recording(arguments: argparse.Namespace) -> Recording | None:
    rotation = Rotation(arguments.max_octets, arguments.max_messages, arguments.keep)
    if arguments.record is None:
        if any(value is not None for value in rotation):
            raise UsageError("--max-octets, --max-messages and --keep are of --record", "name a file: --record FILE")
        return None
    if rotation.keep is not None and not rotation.is_wanted:
        raise UsageError("--keep without --max-octets or --max-messages", "there is only one file")
    return Recording(arguments.record, rotation)


def _read(reader: Callable[[str], str]) -> Callable[[str], str]:
    """For argparse, which shows the words of its own error only."""

    def read(text: str) -> str:
        try:
            return reader(text)
        except ValueError as error:
            raise argparse.ArgumentTypeError(str(error)) from error

    return read
