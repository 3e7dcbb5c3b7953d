"""captain v2n-tap: shows and records a fleet's messages at a broker."""

import argparse
import json
import time
from collections.abc import Callable
from pathlib import Path

from board.runtime.errors import UsageError
from drivers.mqtt import profile as mqtt_profile
from drivers.wire.v2n.profile import Profile
from firmware.client.arguments import integer, message_type, seconds, times
from firmware.client.show.table import Screen
from firmware.tap import topics
from firmware.tap.arguments import add_broker, settings_of
from firmware.tap.connection import ANSWER_S, Connection
from firmware.tap.counts import Taken
from firmware.tap.display import Display, line
from firmware.tap.recording import Recording, Rotation
from firmware.tap.tap import Tap, TapFilter, run, say

DESCRIPTION = """\
Receives the messages that vehicles publish at an MQTT broker. Shows them as a
live table, as lines or as JSON, and records them. All copies with the same
--group share one subscription. The broker gives each message to one of them, so
that together they receive more than one alone. Copies may come and go: a
copy unsubscribes, takes the messages that the broker has sent it, and ends.

Unreadable messages are counted by reason, with the last sample. Totals go to
standard error at the end.
"""
EPILOG = """\
examples:
  captain v2n-tap --url mqtts://broker.example --ca ca.pem --certificate me.pem --key me.key
                                            a live table, until Ctrl-C
  captain v2n-tap --url mqtt://localhost --json --duration 60 >minute.jsonl
                                            for programs, and captain decode
  captain v2n-tap --url mqtt://localhost --record drive.jsonl --max-messages 100000
                                            files of 100,000 messages each:
                                            drive.000001.jsonl and so on;
                                            start it again for a second copy
  captain v2n-tap --url mqtt://localhost --profile orange --tile 120203 --published
                                            messages of vehicles in one tile
  captain v2n-tap --url mqtt://localhost --group "" --lines --type denm
                                            every DENM, without sharing

Keys of JSON, one object a line, also in files of JSON lines:
  type, station_id, message_id, protocol_version, octets, hex
        of the PDU

  received (Unix time in s), topic, btp_port, source
        of the broker; port and source if topic or payload name them

A pcap file has the messages in GeoNetworking frames, without topic and source.

exit codes:
  0    the count or the duration was reached, or SIGTERM
  1    no broker answers, it refuses, or a file cannot be written
  2    wrong usage
  130  Ctrl-C
"""
GROUP = "captain"
LEAST_ANSWER_S = 1.0  # seconds; a TLS handshake over a mobile network takes three round trips
LEAST_FILE = 4096  # octets; in most profiles, one message with the longest PDU and topic is smaller


def arguments(parser: argparse.ArgumentParser) -> None:
    how = parser.add_mutually_exclusive_group()
    how.add_argument("--json", action="store_true", help="one JSON object a line for each message")
    how.add_argument("--lines", action="store_true", help="one line for each message")
    how.add_argument("--quiet", action="store_true", help="only the totals at the end")
    what = parser.add_argument_group("selection")
    what.add_argument(
        "--group",
        metavar="NAME",
        type=_read(topics.group_name),
        default=GROUP,
        help="name of the shared subscription (default %(default)s); empty: all messages, without sharing",
    )
    what.add_argument(
        "--filter",
        metavar="F",
        type=_read(topics.own_filter),
        action="append",
        help="topic filter, in place of the profile's; may be repeated",
    )
    what.add_argument("--tile", metavar="QUADKEY", type=_read(topics.quadkey), help="only this tile")
    what.add_argument(
        "--published",
        action="store_true",
        help="topics that vehicles publish to, not those that they subscribe to, if the profile separates them",
    )
    what.add_argument(
        "--type", metavar="T", action="append", type=message_type, default=[], help="only this type; may be repeated"
    )
    what.add_argument("--count", metavar="N", type=times, help="end after N messages")
    what.add_argument("--duration", metavar="S", type=seconds, help="end after S seconds")
    files = parser.add_argument_group("recording")
    files.add_argument("--record", metavar="FILE", type=Path, help="write a new FILE.jsonl or FILE.pcap")
    files.add_argument(
        "--max-octets", metavar="N", type=integer(LEAST_FILE, 2**40), help="begin a new file after N octets"
    )
    files.add_argument("--max-messages", metavar="N", type=times, help="begin a new file after N messages")
    files.add_argument("--keep", metavar="N", type=times, help="keep the last N files of this copy")
    add_broker(parser)


def main(arguments: argparse.Namespace) -> int:
    """Show or record the messages that a broker delivers.

    Raises UsageError for options of a recording without --record, and for --keep without a limit.
    """
    wanted = settings_of(arguments)
    profile = mqtt_profile.load(wanted.profile)
    description = topics.tapped(profile, arguments.published, has_all=bool(arguments.filter))
    filters = arguments.filter or topics.filters(description, wanted.prefix, arguments.tile or "")
    qos = description.qos if wanted.qos is None else wanted.qos
    shared = [(topics.shared(arguments.group, text), qos) for text in filters]
    reader = Profile(description, topics.identity(wanted), mqtt_profile.codec(description))
    recording = _recording(arguments)
    wish = TapFilter(frozenset(map(str, arguments.type)), arguments.count, arguments.duration)
    tap = Tap(reader, wish, recording)
    if arguments.published:
        tap.is_copy = topics.copies(profile, wanted.prefix)
    connection = Connection(wanted, shared, tap.take, tap.counts.refuse, say, _answer_s(arguments.duration))
    try:
        return _shown(connection, tap, arguments)
    finally:
        for told in tap.counts.lines(connection.counts) if connection.has_been_up else ():
            say(told)  # printed below the last table, so that this does not hide it
        if recording is not None:
            recording.close()


def _answer_s(duration: float | None) -> float:
    """Return the time limit for the broker's answers in seconds.

    It is not longer than the duration, but at least LEAST_ANSWER_S.
    """
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
            raise UsageError("--max-octets, --max-messages, --keep: only with --record", "add --record FILE")
        return None
    if rotation.keep is not None and not rotation.is_wanted:
        raise UsageError(
            "--keep: only with --max-octets or --max-messages", "add one of them; otherwise one file is written"
        )
    return Recording(arguments.record, rotation)


def _read(reader: Callable[[str], str]) -> Callable[[str], str]:
    """Return a parser that raises ArgumentTypeError in place of ValueError, whose text argparse would not show."""

    def read(text: str) -> str:
        try:
            return reader(text)
        except ValueError as error:
            raise argparse.ArgumentTypeError(str(error)) from error

    return read
