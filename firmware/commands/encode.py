"""captain encode: fields to octets, the inverse of captain decode --json."""

import argparse

from board.errors import RequestError
from firmware.codec import library, writing
from firmware.codec.arguments import add_edition, each
from firmware.codec.encoding import Wish, encode
from firmware.codec.reading import Object, Pdu, port_of, when_ns
from firmware.user.failures import Failures

DESCRIPTION = """\
Encodes messages: JSON objects {"edition": "cam-1.4.1", "message": {...}} as
`captain decode --json` prints them, one after the other, on one line or many.
With --edition, or if its ITS PDU header announces the edition, the object may be
the message alone. A header that contradicts --edition is refused, unless
--force: receivers go by the header.

WHAT is a file, a folder of files, or the object itself; - or nothing is
standard input. The octets come out as hexadecimal digits, a message a line,
unless --to says.
"""
EPILOG = """\
examples:
  captain decode --json 0202... | captain encode
        prints 0202... again
  captain decode --json cam.bin | jq '.message.header.stationID = 7' | captain encode
        the same CAM of another station
  captain encode cams.jsonl -o cams.pcap
        in GeoNetworking and Ethernet frames, for Wireshark
  captain encode cams.jsonl | captain send -
        and on the air

exit codes:
  0    every message was encoded
  1    a message was not encoded (the others were), or there was none
  2    wrong usage
  130  Ctrl-C
"""


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("what", metavar="WHAT", nargs="*", help="a file, a folder, a JSON object, or -")
    add_edition(parser)
    writing.add_output(parser)
    parser.set_defaults(form="json")


def main(arguments: argparse.Namespace) -> int:
    codec = library.load()
    known = library.editions(codec, arguments.edition)
    failures = Failures()
    wish = Wish(known, arguments.edition, codec.all(), arguments.force)

    def write(item: Pdu | Object) -> None:
        if isinstance(item, Pdu):
            raise RequestError(
                f"{item.origin}: input is octets, expected JSON", "to change the format use `captain convert`"
            )
        made = encode(item, wish)
        if made.warning:
            failures.warn(made.warning)
        out.write(Pdu(made.octets, item.origin, port_of(item), when_ns(item)))

    with writing.output(arguments, "hex") as out:
        return each(arguments, write, failures=failures)
