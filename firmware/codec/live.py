"""The live table of received messages: a row for each type and station, with what the last message says."""

import time
from collections.abc import Iterator, Sequence

from firmware.codec.decoding import Decoder, UndecodableError
from firmware.codec.fields import glance
from firmware.codec.identify import Identity, Unknown
from firmware.codec.reading import Pdu
from firmware.user.listening import Listening
from firmware.user.received import Message
from firmware.user.table import Screen, Table
from firmware.user.tally import HEADS, Row, Tally, cells, doubt

SAYS = "says"
# In the place of the sizes: both do not fit a terminal of 80 columns.
SIZES = HEADS.index(">octets")
DECODED_HEADS = (*HEADS[:SIZES], *HEADS[SIZES + 1 :], SAYS)
TOLD_IN_FULL = 3  # rows whose last undecodable message is explained below the table


class Live:
    """Counts messages and draws the table: often on a terminal, the rows that changed every second elsewhere.

    decoder  None: what messages say is not shown.
    """

    def __init__(self, screen: Screen, listening: Listening, decoder: Decoder | None) -> None:
        self._tally = Tally()
        self._screen = screen
        self._listening = listening
        self._decoder = decoder
        self._marked = time.monotonic()

    @property
    def total(self) -> int:
        return self._tally.total

    def add(self, message: Message) -> None:
        """Count a message; whether it decodes is looked at for each, so that none of those is missed."""
        is_bad = self._decoder is not None and isinstance(self._decoder.find(message.pdu, is_quick=True), Unknown)
        self._tally.add(message, time.monotonic(), is_bad)

    def __call__(self) -> None:
        now = time.monotonic()
        is_due = now - self._marked >= 1.0
        if is_due or self._screen.is_terminal:
            self.draw(now)
        if is_due:
            self._tally.mark(now)
            self._marked = now

    def draw(self, now: float, is_last: bool = False) -> None:
        most = max(1, self._screen.height - 4 - TOLD_IN_FULL)
        rows = self._tally.rows(most)
        if not (self._screen.is_terminal or is_last):
            rows = [row for row in rows if row.last >= self._marked]
        if self._decoder is None:
            doubts = [f"{_whose(row)}: {doubt(row)}" for row in rows if row.implausible][:TOLD_IN_FULL]
            table = Table(self._title(now), HEADS, [cells(row, now) for row in rows], doubts)
        else:
            decoder = self._decoder
            notes = list(_notes([row for row in rows if row.bad], decoder))
            table = Table(self._title(now), DECODED_HEADS, [_cells(row, now, decoder) for row in rows], notes)
        self._screen.show([table])

    def _title(self, now: float) -> str:
        place, pairing = self._listening.place, self._listening.pairing
        parts = [
            time.strftime("%H:%M:%S"),
            f"{place.host}:{place.to_users}",
            f"{self._tally.total} messages in {now - self._listening.started:.0f} s",
        ]
        if pairing.rubbish:
            parts.append(f"{pairing.rubbish} unreadable (last {pairing.sample.hex()})")
        if self._listening.silent_s:
            parts.append(f"no heartbeat for {self._listening.silent_s:.0f} s")
        return "  ".join(parts)


def _cells(row: Row, now: float, decoder: Decoder) -> tuple[str, ...]:
    usual = cells(row, now)
    said = "  ".join(filter(None, (doubt(row), _says(row, decoder))))
    return (*usual[:SIZES], *usual[SIZES + 1 :], said)


def _says(row: Row, decoder: Decoder) -> str:
    """What the last message says, or why it does not decode; and how many did not."""
    bad = f"! {row.bad} bad" if row.bad else ""
    if not row.pdu:
        return bad
    found = decoder.find(row.pdu)
    if isinstance(found, Identity):
        try:
            said = glance(found.message, row.pdu)
            said = f"{found.message.name}: {said}" if found.message.form_of else said
        except (ValueError, MemoryError) as error:  # it decodes, and yet Python does not hold it
            said = f"! {error}"
        doubt = f"? {found.message.name}: {found.doubt}" if found.doubt else ""
        return "  ".join(part for part in (said, bad, doubt) if part)
    return f"{bad}: {found.why if found.nearest is None else found.nearest}"


def _whose(row: Row) -> str:
    return f"{row.type or '(no name)'} of station {row.station}"


def _notes(rows: Sequence[Row], decoder: Decoder) -> Iterator[str]:
    """The last undecodable message of each row, and its likeliest cause."""
    for row in [row for row in rows if row.bad_pdu][:TOLD_IN_FULL]:
        origin = _whose(row)
        try:
            decoder.identify(Pdu(row.bad_pdu, origin), is_quick=True)
        except UndecodableError as error:
            yield f"! {error.message}; {error.hint}: {row.bad_pdu[:64].hex()}"
    if len(rows) > TOLD_IN_FULL:
        yield f"! {len(rows) - TOLD_IN_FULL} more rows have messages that do not decode"
