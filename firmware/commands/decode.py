"""captain decode: decodes messages and shows their fields."""

import argparse
import sys
from collections.abc import Sequence

from firmware.client.show.table import Table, lines_for, width_of
from firmware.codec import library
from firmware.codec.arguments import FORMS_HELP, add_edition, add_input, each, print_json
from firmware.codec.decoding import Decoder, record
from firmware.codec.encoding import Wish, pdu_from
from firmware.codec.library import Message
from firmware.codec.reading import Object, Pdu
from firmware.codec.showing import tree

DESCRIPTION = f"""\
Decodes messages and shows their fields with units and meanings.

It finds type and edition by the ITS PDU header, by the BTP port of a capture,
and by trial. An edition fits if encoding gives the same octets again. The
output names the edition and the reason. A warning lists other editions of the
same protocolVersion that decode to different values. A header that contradicts
--edition is refused, unless --force is given.

{FORMS_HELP}"""
EPILOG = """\
examples:
  captain decode 02029b260aa393e6005a6f0d...  a CAM
  captain decode drive.pcapng                 every message of a capture
  captain decode --json drive.pcapng          one JSON object per message
  captain decode --json 0202... | captain encode
                                              prints 0202... again
  captain decode --plain 0202...              JSON in SI units
  captain listen --json | captain decode      received messages
  captain decode --list                       all editions of the library

JSON, one object per message; test `error` first:
  edition     edition, such as cam-1.4.1
  type        type, such as cam
  why         reason for the edition
  candidates  editions that give the same octets again, the preferred one first
  origin      place in the input
  octets      length
  form        "plain" with --plain
  message     fields; names and structure of JER (ITU-T X.697)
  btp_port    BTP port of a captured message
  received    its Unix time in s
  carried     its layers
  is_exact    false if encoding gives other octets; `hex` has the decoded ones
  warning     why values may be wrong
  others      editions that decode to different values

JSON of an undecodable message, without `edition` and `message`:
  error, hint, reason, path, bit, hex, and nearest_edition, which decodes the
  most bits

exit codes:
  0    every message was decoded
  1    a message did not decode (the others are shown), or the input was empty
  2    wrong usage
  130  Ctrl-C
"""


def arguments(parser: argparse.ArgumentParser) -> None:
    add_input(parser)
    add_edition(parser)
    parser.add_argument("--json", action="store_true", help="one JSON object per message")
    parser.add_argument("--plain", action="store_true", help="as --json, but in SI units, with names of special values")
    parser.add_argument(
        "--list", action="store_true", help="list the editions of the library, with messageID and BTP port"
    )


def main(arguments: argparse.Namespace) -> int:
    codec = library.load()
    decoder = Decoder(codec, arguments.edition, arguments.force)
    wish = Wish(decoder.known, arguments.edition, codec.all(), arguments.force)
    is_json = arguments.json or arguments.plain
    if arguments.list:
        _list(decoder.known, is_json)
        return 0

    def decode(item: Pdu | Object) -> None:
        pdu, _ = pdu_from(item, wish)
        found = decoder.identify(pdu)
        text = record(pdu, found, arguments.plain) if is_json else tree(pdu, found, width_of(sys.stdout))
        print(text, flush=True)

    return each(arguments, decode, is_json)


def _list(known: list[Message], is_json: bool) -> None:
    if is_json:
        for message in known:
            print_json(_described(message))
        return
    heads = ("edition", ">messageID", ">version", ">port", "standard")
    rows = [
        (
            message.name,
            _numbers(message.ids),
            _numbers(message.versions),
            str(message.btp_port or "-"),
            message.standard + (", experimental" if message.is_experimental else ""),
        )
        for message in known
    ]
    title = f"{len(known)} messages; of one type the preferred edition first; port: BTP"
    print("\n".join(lines_for(Table(title, heads, rows), sys.stdout)))


def _numbers(numbers: Sequence[int]) -> str:
    return ", ".join(map(str, numbers)) or "-"


def _described(message: Message) -> dict[str, object]:
    return {
        "edition": message.name,
        "type": message.type,
        "release": message.release,
        "standard": message.standard,
        "message_ids": list(message.ids),
        "protocol_versions": list(message.versions),
        "btp_port": message.btp_port or None,
        "rank": message.rank,
        "is_experimental": message.is_experimental,
    }
