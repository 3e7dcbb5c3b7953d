"""captain encode: encodes fields to octets, the inverse of decode --json."""

import argparse
import json

from board.runtime.errors import RequestError
from firmware.client.show.failures import Failures
from firmware.codec import library, writing
from firmware.codec.arguments import add_edition, each
from firmware.codec.encoding import Wish, encode
from firmware.codec.example import example
from firmware.codec.reading import Object, Pdu, port_of, when_ns
from firmware.codec.schema import schema

DESCRIPTION = """\
Encodes messages. The input is JSON objects {"edition": "cam-1.4.1", "message":
{...}}, as of `captain decode --json`, each on one or several lines.

Numbers are those of the standard, or in SI units if the object has "form":
"plain", as of `captain decode --plain`.

The object may be the message alone, if --edition or its ITS PDU header gives
the edition. A header that contradicts --edition is refused, unless --force is
given: receivers use the header.

The argument WHAT is a file, a folder of files, or the object itself. Without
it, or with -, the command reads standard input. The output is hexadecimal
digits, one message per line, unless --to is given.

With --example, the command makes a legal message of an edition; it reads no
input. WHAT are fields NAME=VALUE. NAME is a short name (speed) or a path
(cam.camParameters.basicContainer.stationType); an unknown name lists those
there are. VALUE is in the SI unit or degree, or the name of a special value
(unavailable) or item (passengerCar).
"""
EPILOG = """\
examples:
  captain decode --json 0202... | captain encode
        prints 0202... again
  captain decode --json cam.bin | jq '.message.header.stationID = 7' | captain encode
        the same CAM of another station
  captain encode cams.jsonl -o cams.pcap
        GeoNetworking in Ethernet frames, for Wireshark
  captain encode cams.jsonl | captain send -
        encode and send
  captain encode --example cam speed=13.9 latitude=48.7668 longitude=11.4321
        a CAM at 13.9 m/s; all other values are "unavailable"
  captain encode --example denm-1.3.1 cause=94 | captain send -
        a DENM of a stationary vehicle
  captain encode --schema cam-1.4.1 --plain
        JSON schema of the objects, for editors and validators

exit codes:
  0    every message was encoded
  1    a message was not encoded (the others were), or the input was empty
  2    wrong usage
  130  Ctrl-C
"""


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("what", metavar="WHAT", nargs="*", help="a file, a folder, a JSON object, or -")
    other = parser.add_mutually_exclusive_group()
    other.add_argument("--example", metavar="E", help="make a message of edition (cam-1.4.1) or type (cam) E")
    other.add_argument(
        "--schema", metavar="E", help="print the JSON schema of an edition or type; of SI units with --plain"
    )
    add_edition(parser)
    parser.add_argument("--plain", action="store_true", help='read objects without "form" in SI units')
    writing.add_output(parser)
    parser.set_defaults(form="json")


def main(arguments: argparse.Namespace) -> int:
    codec = library.load()
    if arguments.schema is not None:
        message = library.editions(codec, arguments.schema, "--schema")[0]
        print(json.dumps(schema(message, arguments.plain), indent=2))
        return 0
    if arguments.example is not None:
        with writing.output(arguments, "hex") as out:
            out.write(example(codec, arguments.example, arguments.what))
        return 0
    known = library.editions(codec, arguments.edition)
    failures = Failures()
    wish = Wish(known, arguments.edition, codec.all(), arguments.force, arguments.plain)

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
