"""captain listen: what a station's users receive: counted per type and station, or one message after the other."""

import argparse
import json
import sys
import time
from collections.abc import Callable, Sequence
from typing import TypeAlias

from board.errors import RequestError, UsageError
from firmware.codec import fields, library, showing
from firmware.codec.decoding import Decoder, UndecodableError, doubt_record, joined, refusal_record
from firmware.codec.library import NoLibraryError, load
from firmware.codec.live import Live
from firmware.codec.reading import Pdu
from firmware.printable import clean
from firmware.user import client
from firmware.user.arguments import add_station, address
from firmware.user.listening import Listening, add_wish, wish_of
from firmware.user.marks import Marks
from firmware.user.received import Message
from firmware.user.table import Screen, width_of

DESCRIPTION = """\
Listens to a station as any user's program does, and shows for each type and
station (stationID of the ITS PDU header): how many messages, how many a
second, the last signal strength where the interface knows it, how long ago the
last one came, and what it says: position in degrees, speed, heading; the cause
of a DENM; how many objects or intersections. A row that begins with `!` has a
problem: why the message does not decode, or how many messages the station has
marked as implausible and the reasons of the last one: `! 3 implausible: time`
(README, "Implausible messages").

On a terminal the table stays in place; elsewhere the stations heard in the
last second are printed every second, and all of them at the end. At most 256 rows are kept: those silent
longest are folded into the row `others`.

--full and --fields show message after message instead. Where the program has
no message library (`captain doctor` tells), and with --headers, the table has
the sizes of messages in place of what they say.
"""
EPILOG = """\
examples:
  captain listen                            everything, until Ctrl-C
  captain listen --type denm --count 1 --full
                                            wait for one DENM and show all of it
  captain listen --station-id 1337 --fields speedValue,headingValue
                                            two fields of each message of one
                                            station
  captain listen --json --duration 60 >log  a minute of messages
  captain listen --json --decode | jq .message.cam
                                            their fields, for a program
  captain listen --json | captain send - --station 127.0.0.1:5565
                                            one station sends on what another
                                            one receives
JSON, one object a line:
  type, station_id, message_id, protocol_version, octets, hex
        of the PDU; null where it is too short
  received (Unix time in s), rssi_dbm, data_rate (500 kbit/s), traffic_class,
  hop_limit, source_mac, security, latitude, longitude (degrees)
        of the interface, as RawRxMessage has them; absent without one
  implausible
        list of reasons why the station marked the message as implausible
  edition, message, warning and others where the values may be wrong
        with --decode; `captain encode` takes them
  edition, fields (path: value with unit)
        with --fields
  error (reason, cause, edition, path, bit)
        with either, where the message does not decode

exit codes:
  0    the count or the duration is reached
  1    no station answers, or fields are wanted and there is no message library
  2    wrong usage
  130  Ctrl-C
"""

Show: TypeAlias = Callable[[Message], str]


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--json", action="store_true", help="one JSON object a line for each message")
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
    if (arguments.decode and not arguments.json) or (arguments.full and arguments.json):
        raise UsageError("--json goes with --decode or --fields, --decode with --json")
    place = address(arguments)
    try:
        show = _shower(arguments)
    except RequestError as error:
        raise UsageError(f"--fields: {error.message}", error.hint) from error
    with client.session() as context:
        # Everything, where all types are wanted: what a station should not publish is to be seen as well.
        # A messageID has whatever name the station gives it.
        types = [f"v2x.{kind}." if isinstance(kind, str) else "v2x." for kind in arguments.type]
        topics = ["hb.", "raw.", *types] if types else [""]
        subscriber = client.subscribe(context, place, place.to_users, *topics)
        listening = Listening(subscriber, place, wish_of(arguments), Marks(context, place))
        if show is None:
            _show_table(listening, None if arguments.headers else _decoder())
        else:
            _show_each(listening, show)
    return 0


def _shower(arguments: argparse.Namespace) -> Show | None:
    """What prints each message; None for the table. Raises NoLibraryError, RequestError for unknown fields."""
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
    """The messages of the library that may come; all of them where a station's own name or number may be any."""
    fits = [[one for one in decoder.known if kind == one.type or kind in one.ids] for kind in kinds]
    return [one for several in fits for one in several] if fits and all(fits) else list(decoder.known)


def _decoder() -> Decoder | None:
    """None where headers are all that can be shown."""
    try:
        return Decoder(load())
    except NoLibraryError:
        return None


def _names(text: str) -> list[str]:
    names = [name.strip() for name in text.split(",") if name.strip(" .")]
    if not names:
        raise argparse.ArgumentTypeError(f"{text!r} names no field; as speedValue,header.stationID")
    return names


# -- one message after the other


def _show_each(listening: Listening, show: Show) -> None:
    told = False

    def idle() -> None:
        nonlocal told
        if (listening.silent_s > 0) != told:
            told = not told
            print("captain: no heartbeat, waiting" if told else "captain: heartbeat again", file=sys.stderr)

    for message in listening.messages(idle):
        print(show(message), flush=True)


def described(message: Message) -> dict[str, object]:
    """A message as `--json` prints it: header fields of the PDU, and what the interface knew."""
    pdu = message.pdu
    found: dict[str, object] = {
        "type": message.type,
        "station_id": message.station_id,
        "message_id": message.message_id,
        "protocol_version": pdu[0] if pdu else None,
        "octets": len(pdu),
    }
    if message.raw is not None:
        rx = message.raw.rx
        found |= {
            "received": message.raw.received_ns // 1000 / 1e6,
            "rssi_dbm": rx.rssi_dbm or None,  # RawRxMessage has 0 where it is not known
            "data_rate": rx.data_rate,
            "traffic_class": rx.traffic_class,
            "hop_limit": rx.hop_limit,
            "source_mac": rx.source_mac.hex(":"),
            "security": rx.security.status.name.lower(),
            "latitude": rx.position.latitude / 1e7,
            "longitude": rx.position.longitude / 1e7,
        }
    if message.implausible:
        found["implausible"] = message.implausible
    return found | {"hex": pdu.hex()}


def _decoded(message: Message, decoder: Decoder, names: list[str] | None) -> str:
    """The same with `edition` and `message` or `fields`, or with `error`."""
    head = described(message)
    try:
        identity = decoder.identify(_pdu(message))
    except UndecodableError as error:
        return json.dumps(head | {"error": refusal_record(error)})
    found = identity.message
    head |= {"edition": found.name} | doubt_record(identity)
    if names:
        return json.dumps(head | {"fields": fields.chosen(found.explain(message.pdu), names)})
    return joined(head, "message", found.to_json(message.pdu))


def _full(message: Message, decoder: Decoder) -> str:
    pdu = _pdu(message)
    try:
        return _doubt(message, "\n") + showing.tree(pdu, decoder.identify(pdu), width_of(sys.stdout))
    except UndecodableError as error:
        return _refused(error) + "\n"


def _line(message: Message, decoder: Decoder, names: list[str]) -> str:
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


def _doubt(message: Message, end: str = "") -> str:
    return f"! implausible: {', '.join(message.implausible)}{end}" if message.implausible else ""


def _refused(error: UndecodableError) -> str:
    """A message that does not decode, on one line; its octets, so that it can be looked at."""
    return clean(f"{error.message}; {error.hint}: {error.pdu.octets.hex()}")


def _pdu(message: Message) -> Pdu:
    """Its origin is when it came, what it is and whose."""
    received_ns = None if message.raw is None else message.raw.received_ns
    now = time.time() if received_ns is None else received_ns / 1e9
    stamp = time.strftime("%H:%M:%S", time.localtime(now)) + f".{round(now % 1 * 1000) % 1000:03}"
    whose = "-" if message.station_id is None else str(message.station_id)
    return Pdu(message.pdu, f"{stamp} {message.type or '(no name)'} {whose}", when_ns=received_ns)


# -- the table


def _show_table(listening: Listening, decoder: Decoder | None) -> None:
    with Screen() as screen:
        live = Live(screen, listening, decoder)
        for message in listening.messages(live):
            live.add(message)
        live.draw(time.monotonic(), is_last=True)
    print(f"{live.total} messages in {time.monotonic() - listening.started:.1f} s")
