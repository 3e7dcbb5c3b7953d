"""captain explain: explains a message bit by bit."""

import argparse
import sys
import textwrap
from collections.abc import Iterator, Sequence

from firmware.client.show.table import Table, plain, width_of
from firmware.codec import bits, library
from firmware.codec.arguments import FORMS_HELP, add_edition, add_input, each, print_json
from firmware.codec.decoding import Decoder, UndecodableError, doubt_record
from firmware.codec.encoding import Wish, pdu_from
from firmware.codec.library import Message
from firmware.codec.reading import Object, Pdu
from firmware.printable import clean

DESCRIPTION = f"""\
Explains every bit of a message: offset, width, bits, field, value, and clause
of ITU-T X.691. For an undecodable message it shows all rows up to the first bad
bit, and the likeliest cause.

{FORMS_HELP}"""
EPILOG = """\
examples:
  captain explain 02029b260aa393e6005a6f0d...
  captain explain --edition cam-1.4.1 --force cam.bin
        as this edition, regardless of the header
  captain explain --json cam.bin | jq 'select(.path | endswith("speedValue"))'

JSON, one object per row; test `error` first:
  origin, edition, bit, width, path, name, value, bits, clause, and `warning` if
  values may be wrong. A name in parentheses is a part of the encoding.

JSON of an undecodable message:
  error, hint, reason, path, bit, origin, octets, hex, and nearest_edition, which
  is that of the rows

exit codes:
  0    every message was decoded
  1    a message did not decode, or the input was empty
  2    wrong usage
  130  Ctrl-C
"""
WIDEST = 1000  # columns: names and values are never cut
HEADS = (">bit", ">width", "bits", "X.691", "field", "value")


def arguments(parser: argparse.ArgumentParser) -> None:
    add_input(parser)
    add_edition(parser)
    parser.add_argument("--json", action="store_true", help="one JSON object per row")


def main(arguments: argparse.Namespace) -> int:
    codec = library.load()
    decoder = Decoder(codec, arguments.edition, arguments.force)
    wish = Wish(decoder.known, arguments.edition, codec.all(), arguments.force)

    def explain(item: Pdu | Object) -> None:
        pdu, _ = pdu_from(item, wish)
        _explain(pdu, decoder, arguments.json)

    return each(arguments, explain, arguments.json)


def _explain(pdu: Pdu, decoder: Decoder, is_json: bool) -> None:
    """Print the rows of a message; of an undecodable one, those before its first bad bit. Raises RequestError."""
    try:
        found = decoder.identify(pdu)
    except UndecodableError as error:
        if error.nearest is not None:
            _show(pdu, error.nearest.message, [f"as far as it decodes: {error.nearest}"], {}, is_json)
        raise
    notes = [found.why, f"warning: {found.doubt}"] if found.doubt else [found.why]
    _show(pdu, found.message, notes, doubt_record(found), is_json)


def _show(pdu: Pdu, message: Message, notes: list[str], doubt: dict[str, object], is_json: bool) -> None:
    rows = list(bits.rows(pdu.octets, message.explain(pdu.octets)))
    if is_json:
        for row in rows:
            told = row._asdict() | {"origin": pdu.origin, "edition": message.name} | doubt
            print_json({key: value for key, value in told.items() if key != "depth"})
        return
    title = f"{message.name}: {message.standard}, {len(pdu.octets)} octets, {pdu.origin}"
    width = width_of(sys.stdout) if sys.stdout.isatty() else WIDEST
    lines = _fitted(plain(Table("", HEADS, _cells(rows)), WIDEST), width)
    print("\n".join([*plain(Table(title), width), *lines, *plain(Table("", notes=notes), width), ""]), flush=True)


def _fitted(lines: Sequence[str], width: int) -> Iterator[str]:
    """Yield the lines of rows; the value of a too wide one is a line of its own, at the right."""
    start = lines[0].index(HEADS[-1])
    for line in lines:
        if len(line) > width:
            yield line[:start].rstrip()
            yield from (part.rjust(width) for part in textwrap.wrap(line[start:], width))
        else:
            yield line


def _cells(rows: Sequence[bits.Row]) -> list[tuple[str, ...]]:
    """Return the cells of the rows; a container's position is that of its first bit."""
    return [
        (
            str(row.bit),
            str(row.width) if row.width else "",
            row.bits,
            row.clause,
            bits.INDENT * row.depth + clean(row.name),
            row.value,
        )
        for row in rows
    ]
