"""captain decode: octets of messages to their fields."""

import argparse
import sys
from collections.abc import Sequence

from firmware.codec import library
from firmware.codec.arguments import FORMS_HELP, add_edition, add_input, each, print_json
from firmware.codec.decoding import Decoder, record
from firmware.codec.library import Message
from firmware.codec.reading import Object, Pdu, pdu_of
from firmware.codec.showing import tree
from firmware.user.table import Table, lines_for, width_of

DESCRIPTION = f"""\
Decodes messages and shows their fields with units and meanings. Type and
edition are found by the ITS PDU header, by the BTP port of a capture and by
trial: an edition fits that gives the same octets back. The output names the
edition and the reason. The header selects the edition: a header that
contradicts --edition is refused, unless --force. A warning lists other editions
of the same protocolVersion that decode to different values.

{FORMS_HELP}"""
EPILOG = """\
examples:
  captain decode 02029b260aa393e6005a6f0d...  a CAM
  captain decode drive.pcapng                 every message of a capture
  captain decode --json drive.pcapng          one JSON object a line
  captain decode --json 0202... | captain encode
                                              prints 0202... again
  captain listen --json | captain decode      what a station receives
  captain decode --list                       all editions of the library
JSON, one object a line:
  edition, type, why, candidates (editions that give the same octets back, the
        preferred one first), origin, octets, message (names and shapes of JER,
        ITU-T X.697)
  btp_port, received (Unix time in s), carried
        of a capture
  is_exact (false), hex
        where the message is encoded to other octets than were decoded
  warning, others (editions that decode to different values)
        where the values may be wrong
  error (reason, cause, edition, path, bit), hex
        in place of `message` where it does not decode

exit codes:
  0    every message was decoded
  1    a message was not decoded (the others are shown), or there was none
  2    wrong usage
  130  Ctrl-C
"""


def arguments(parser: argparse.ArgumentParser) -> None:
    add_input(parser)
    add_edition(parser)
    parser.add_argument("--json", action="store_true", help="one JSON object a line for each message")
    parser.add_argument("--list", action="store_true", help="the editions that the library has, and how they are known")


def main(arguments: argparse.Namespace) -> int:
    decoder = Decoder(library.load(), arguments.edition, arguments.force)
    if arguments.list:
        _list(decoder.known, arguments.json)
        return 0

    def decode(item: Pdu | Object) -> None:
        pdu = pdu_of(item)
        found = decoder.identify(pdu)
        print(record(pdu, found) if arguments.json else tree(pdu, found, width_of(sys.stdout)), flush=True)

    return each(arguments, decode, arguments.json)


def _list(known: list[Message], is_json: bool) -> None:
    if is_json:
        for message in known:
            print_json(_described(message))
        return
    heads = ("edition", "standard", ">messageID", ">version", ">BTP port", "")
    rows = [
        (
            message.name,
            message.standard,
            _numbers(message.ids),
            _numbers(message.versions),
            str(message.btp_port or "-"),
            "experimental" if message.is_experimental else "",
        )
        for message in known
    ]
    title = f"{len(known)} messages; of one type the preferred edition first"
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
