"""captain listen: shows what a station's users receive, counted or message by message."""

import argparse
import json
import re
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from typing import TypeAlias

from board.runtime.errors import RequestError, UsageError
from drivers.message import NO_MAC
from firmware.client import client
from firmware.client.arguments import add_station, address
from firmware.client.keyboard import Keyboard
from firmware.client.listening import Listening, add_wish, wish_of
from firmware.client.received import Delivered, Delivery
from firmware.client.show.table import Screen, width_of
from firmware.codec import fields, library, showing
from firmware.codec.decoding import Decoder, UndecodableError, doubt_record, joined, refusal_record
from firmware.codec.library import NoLibraryError, load
from firmware.codec.live import Live
from firmware.codec.reading import Pdu
from firmware.printable import clean

DESCRIPTION = """\
Shows the messages that a station receives. The table has a row for each type
and station (stationID of the ITS PDU header). A row has the number of messages,
their rate, signal strength if known, age, and contents of the last message.

Contents are position in degrees, speed and heading; the cause of a DENM; the
number of objects or intersections. A row that begins with `!` has a problem.
The message does not decode, or the station has marked messages as implausible,
as in `! 3 implausible: time` (firmware/guide/implausible.md).

Rows are sorted by the priority of their type (DENM first), then by station.
Where a type has several stations, its sum is above the table.

On a terminal the table stays in place: arrow keys, Page Up, Page Down, Home
and End scroll, q ends. Elsewhere the stations heard in the last second are
printed every second, and all of them at the end. At most 1024 rows are kept:
those silent longest are summed in the row `others`.

Messages that this program missed are counted by the station's numbers, with
those above 8,000 of a type per second.

With --full and --fields, each message is shown instead. With --headers, or
without the message library, the table has sizes in place of contents.
"""
EPILOG = """\
examples:
  captain listen                            everything, until Ctrl-C
  captain listen --type denm --count 1 --full
                                            wait for one DENM, show all fields
  captain listen --station-id 1337 --fields speedValue,headingValue
                                            two fields of each message of one
                                            station
  captain listen --json --duration 60 >log  a minute of messages
  captain listen --json --decode | jq .message.cam
                                            fields for a program
  captain listen --json | captain send - --station 127.0.0.1:5565
                                            forward to another station

JSON, one object per message; with --decode or --fields test `error` first:
  type, station_id, message_id, protocol_version, octets, hex. Values of the ITS
  PDU header are null if the PDU is too short.

JSON of the reception:
  received     Unix time in s
  rssi_dbm     signal strength; null if unknown
  data_rate    in 500 kbit/s
  latitude, longitude  of the sender, in degrees; null if unknown
  traffic_class, hop_limit, source_mac, security
  implausible  list of reasons of the station's mark; absent without one
  missed       number of messages of this type missed just before; absent if 0

JSON with --decode or --fields:
  edition      edition of the message
  message      with --decode: all fields; `captain encode` accepts them
  fields       with --fields: path and value with unit
  warning      why values may be wrong
  others       editions that decode to different values

JSON of an undecodable message, with --decode or --fields:
  error, hint, reason, path, bit, and nearest_edition, which decodes the most
  bits

exit codes:
  0    the count or the duration is reached
  1    no station answers, or the message library for fields is missing
  2    wrong usage
  130  Ctrl-C
"""

Show: TypeAlias = Callable[[Delivery], str]
CAUSES = "reader too slow, station restarted, or more than 8,000 of a type per second"
MAC = re.compile(r"(?:[0-9a-f]{2}:){5}[0-9a-f]{2}")  # the source of a message may also be a name at a broker


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--json", action="store_true", help="one JSON object per message")
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--decode", action="store_true", help="with --json: the decoded message as well")
    what.add_argument("--full", action="store_true", help="all fields of each message, with units and meanings")
    what.add_argument(
        "--fields",
        metavar="F,F",
        type=_names,
        help="these fields of each message, a line each: last parts of their paths, as speedValue or header",
    )
    what.add_argument("--headers", action="store_true", help="do not decode")
    add_wish(parser)
    add_station(parser)


def main(arguments: argparse.Namespace) -> int:
    """Print the messages that a station publishes to its users.

    Raises UsageError for options that exclude each other, and for invalid --fields.
    """
    if (arguments.decode and not arguments.json) or (arguments.full and arguments.json):
        raise UsageError("--decode needs --json; --full and --json exclude each other")
    place = address(arguments)
    try:
        show = _shower(arguments)
    except RequestError as error:
        raise UsageError(f"--fields: {error.message}", error.hint) from error
    with client.session() as context:
        # For a messageID, all types are subscribed, since a station may give it any name.
        types = [f"message.{kind}." if isinstance(kind, str) else "message." for kind in arguments.type]
        subscriber = client.subscribe(context, place, place.report, *(types or ["message."]), "status.")
        delivered = Delivered()
        listening = Listening(subscriber, f"{place.host}:{place.report}", wish_of(arguments), delivered)
        if show is None:
            _show_table(listening, delivered, None if arguments.headers else _decoder())
        else:
            _show_each(listening, delivered, show)
    return 0


def _shower(arguments: argparse.Namespace) -> Show | None:
    """Return the function that formats each message; None for the table.

    Raises NoLibraryError without a message library, RequestError for unknown fields.
    """
    if arguments.decode or arguments.full or arguments.fields:
        decoder = Decoder(load())
        if arguments.fields:
            fields.FieldNames(_listened(decoder, arguments.type)).check(arguments.fields)
        if arguments.full:
            return lambda message: _full(message, decoder)
        if arguments.json:
            return lambda message: _decoded(message, decoder, arguments.fields)
        return lambda message: _line(message, decoder, arguments.fields)
    return (lambda message: json.dumps(described(message))) if arguments.json else None


def _listened(decoder: Decoder, kinds: Sequence[str | int]) -> list[library.Message]:
    """Return the library's messages that may be received; all of them if a selected type is unknown to the library."""
    fits = [[one for one in decoder.known if kind == one.type or kind in one.ids] for kind in kinds]
    return [one for several in fits for one in several] if fits and all(fits) else list(decoder.known)


def _decoder() -> Decoder | None:
    """Return a decoder; None without the message library: then only headers are shown."""
    try:
        return Decoder(load())
    except NoLibraryError:
        return None


def _names(text: str) -> list[str]:
    names = [name.strip() for name in text.split(",") if name.strip(" .")]
    if not names:
        raise argparse.ArgumentTypeError(f"{text!r} names no field; name some, such as speedValue,header.stationID")
    return names


# -- output of single messages


def _show_each(listening: Listening[Delivery], delivered: Delivered, show: Show) -> None:
    told = False

    def idle() -> None:
        nonlocal told
        if (listening.silent_s > 0) != told:
            told = not told
            print(f"captain: the station is {'silent, waiting' if told else 'heard again'}", file=sys.stderr)

    try:
        for message in listening.messages(idle):
            print(show(message), flush=True)
    finally:
        if delivered.missed:
            print(f"captain: {delivered.missed} messages missed: {CAUSES}", file=sys.stderr)


def described(message: Delivery) -> dict[str, object]:
    """Return a message as an object for `--json`: header fields of the PDU, and metadata of the interface."""
    pdu, position = message.pdu, message.position or {}
    found: dict[str, object] = {
        "type": message.type,
        "station_id": message.station,
        "message_id": pdu[1] if len(pdu) > 1 else None,
        "protocol_version": pdu[0] if pdu else None,
        "octets": len(pdu),
        "received": message.received_ns // 1000 / 1e6,
        "rssi_dbm": message.rssi_dbm,
        "data_rate": message.data_rate,
        "traffic_class": message.traffic_class,
        "hop_limit": message.hop_limit,
        "source_mac": message.source if MAC.fullmatch(message.source) else NO_MAC.hex(":"),
        "security": message.security,
        "latitude": position.get("latitude"),
        "longitude": position.get("longitude"),
    }
    if message.implausible:
        found["implausible"] = message.implausible
    if message.missed:
        found["missed"] = message.missed
    return found | {"hex": pdu.hex()}


def _decoded(message: Delivery, decoder: Decoder, names: list[str] | None) -> str:
    """Return a message as JSON with `edition` and `message` or `fields`, or with `error` and `hint`."""
    head = described(message)
    try:
        identity = decoder.identify(_pdu(message))
    except UndecodableError as error:
        return json.dumps(head | refusal_record(error))
    found = identity.message
    head |= {"edition": found.name} | doubt_record(identity)
    if names:
        return json.dumps(head | {"fields": fields.chosen(found.explain(message.pdu), names)})
    return joined(head, "message", found.to_json(message.pdu))


def _full(message: Delivery, decoder: Decoder) -> str:
    pdu = _pdu(message)
    try:
        return _doubt(message, "\n") + showing.tree(pdu, decoder.identify(pdu), width_of(sys.stdout))
    except UndecodableError as error:
        return _refused(error) + "\n"


def _line(message: Delivery, decoder: Decoder, names: list[str]) -> str:
    pdu = _pdu(message)
    try:
        found = decoder.identify(pdu)
    except UndecodableError as error:
        return _refused(error)
    values = fields.brief(fields.chosen(found.message.explain(pdu.octets), names), names)
    told = [f"{path}={value}" for path, value in values.items()] or ["it has none of these"]
    told += [f"(warning: {found.doubt})"] if found.doubt else []
    told += [_doubt(message)] if message.implausible else []
    form = f", {found.message.name}" if found.message.form_of else ""
    return clean(f"{pdu.origin}{form}: {'  '.join(told)}")


def _doubt(message: Delivery, end: str = "") -> str:
    return f"! implausible: {', '.join(message.implausible)}{end}" if message.implausible else ""


def _refused(error: UndecodableError) -> str:
    """Return one line for an undecodable message, with its octets."""
    return clean(f"{error.message}; {error.hint}: {error.pdu.octets.hex()}")


def _pdu(message: Delivery) -> Pdu:
    """Return a message as a PDU whose origin is its time, type and station."""
    now = message.received_ns / 1e9
    stamp = time.strftime("%H:%M:%S", time.localtime(now)) + f".{round(now % 1 * 1000) % 1000:03}"
    whose = "-" if message.station is None else str(message.station)
    return Pdu(message.pdu, f"{stamp} {message.type or '(no name)'} {whose}", when_ns=message.received_ns)


# -- output as a table


def _show_table(listening: Listening[Delivery], delivered: Delivered, decoder: Decoder | None) -> None:
    with Screen() as screen, ExitStack() as ending:
        keyboard = ending.enter_context(Keyboard()) if screen.is_terminal else None
        has_keys = keyboard is not None and keyboard.is_there
        live = Live(screen, listening, delivered, decoder, has_keys)
        if keyboard is not None and has_keys:
            listening.watch(keyboard.fileno(), lambda: _typed(keyboard, live))
        for message in listening.messages(live):
            live.add(message)
        live.draw(time.monotonic(), is_last=True)
    print(f"{live.total} messages in {time.monotonic() - listening.started:.1f} s")


def _typed(keyboard: Keyboard, live: Live) -> bool:
    """Scroll by the keys that were typed; return False to end."""
    keys = keyboard.read()
    if keys is None or "quit" in keys:
        return False
    for key in keys:
        live.press(key, time.monotonic())
    return True
