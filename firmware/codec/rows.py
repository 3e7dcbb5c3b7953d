"""Rows of a table of received messages, with the last message's contents."""

from collections.abc import Iterator, Sequence

from firmware.client.show.tally import HEADS, TallyRow, cells, doubt
from firmware.codec.decoding import Decoder, UndecodableError
from firmware.codec.fields import glance
from firmware.codec.identify import Identity
from firmware.codec.reading import Pdu

SAYS = "says"
# The contents replace the column of sizes: both together do not fit a terminal of 80 columns.
SIZES = HEADS.index(">octets")
DECODED_HEADS = (*HEADS[:SIZES], *HEADS[SIZES + 1 :], SAYS)
EXPLAINED = 3  # limit of rows whose last undecodable message is explained below the table


def cells_of(row: TallyRow, now: float, decoder: Decoder) -> tuple[str, ...]:
    """Return the cells of a row for DECODED_HEADS. now: monotonic time in seconds."""
    usual = cells(row, now)
    return (*usual[:SIZES], *usual[SIZES + 1 :], "  ".join(filter(None, (doubt(row), _says(row, decoder)))))


def _says(row: TallyRow, decoder: Decoder) -> str:
    """Return the contents of the last message, or why it does not decode, and the number of undecodable ones."""
    bad = f"! {row.bad} bad" if row.bad else ""
    if not row.pdu:
        return bad
    found = decoder.find(row.pdu)
    if isinstance(found, Identity):
        try:
            said = glance(found.message, row.pdu)
            said = f"{found.message.name}: {said}" if found.message.form_of else said
        except (ValueError, MemoryError) as error:  # it decodes, but its Python values need too much memory
            said = f"! {error}"
        doubt = f"? {found.message.name}: {found.doubt}" if found.doubt else ""
        return "  ".join(part for part in (said, bad, doubt) if part)
    return f"{bad}: {found.why if found.nearest is None else found.nearest}"


def whose(row: TallyRow) -> str:
    """Return type and station of a row, for a note below the table."""
    return f"{row.type or '(no name)'} of station {row.station}"


def notes(rows: Sequence[TallyRow], decoder: Decoder) -> Iterator[str]:
    """Yield a note for the last undecodable message of each row, with its likeliest cause."""
    for row in [row for row in rows if row.bad_pdu][:EXPLAINED]:
        origin = whose(row)
        try:
            decoder.identify(Pdu(row.bad_pdu, origin), is_quick=True)
        except UndecodableError as error:
            yield f"! {error.message}; {error.hint}: {row.bad_pdu[:64].hex()}"
    if len(rows) > EXPLAINED:
        yield f"! {len(rows) - EXPLAINED} more rows have messages that do not decode"
