"""Live table of received messages: a row per type and station.

Each row shows the contents of its last message.
"""

import time
from bisect import bisect_left
from collections.abc import Sequence

from firmware.client.listening import Listening
from firmware.client.received import Delivered, Delivery
from firmware.client.show.table import Screen, Table, plain, width_of
from firmware.client.show.tally import HEADS, OTHERS, Tally, TallyRow, cells, doubt, order
from firmware.codec.decoding import Decoder
from firmware.codec.identify import Unknown
from firmware.codec.rows import DECODED_HEADS, EXPLAINED, cells_of, notes, whose

SUM_HEADS = ("type", ">stations", ">count", ">per s")
MOST_SUMS = 6  # most message types with a line of their own on a terminal; all others share one line
KEYS = ": arrows, Page Up, Page Down, Home and End; q ends"


class Live:
    """Counts messages and draws the table.

    A terminal is redrawn at each call; keys scroll to rows without room, and the uppermost row stays while other rows
    appear. Elsewhere the rows that changed are printed every second.

    delivered  reader of the messages, with the numbers of malformed and missed ones.
    decoder    decodes the last messages; None: do not show their contents.
    has_keys   the terminal has keys, which are passed to press().
    """

    def __init__(
        self,
        screen: Screen,
        listening: Listening[Delivery],
        delivered: Delivered,
        decoder: Decoder | None,
        has_keys: bool = False,
    ) -> None:
        self._tally = Tally()
        self._screen = screen
        self._listening = listening
        self._delivered = delivered
        self._decoder = decoder
        self._has_keys = has_keys
        self._marked = time.monotonic()
        self._uppermost: tuple[int, str, int] | None = None  # sort key of the uppermost visible row; None for the first
        self._room = 1  # rows

    @property
    def total(self) -> int:
        return self._tally.total

    def add(self, message: Delivery) -> None:
        """Count a message and decode it, so that every undecodable message is detected."""
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

    def press(self, key: str, now: float) -> None:
        """Scroll by a key of Keyboard, and redraw. now: monotonic time in seconds."""
        rows = self._tally.rows()
        steps = {
            "up": -1,
            "down": 1,
            "page up": -self._room,
            "page down": self._room,
            "home": -len(rows),
            "end": len(rows),
        }
        top = self._top(rows, steps.get(key, 0))
        self._uppermost = order(rows[top]) if top else None
        self.draw(now)

    def draw(self, now: float, is_last: bool = False) -> None:
        """Show the tables. is_last: show all rows, if the screen is not a terminal."""
        rows = self._tally.rows()
        if not self._screen.is_terminal:
            rows = rows if is_last else [row for row in rows if row.last >= self._marked]
            sums = self._sums(now) if is_last else []
            self._screen.show(self._tables(now, sums, rows, self._notes(rows)))
            return
        sums, below = self._sums(now), self._notes(rows)
        width = width_of(self._screen.stream)
        taken = sum(len(plain(table, width)) for table in self._tables(now, sums, [], below))
        room = self._screen.height - taken - (2 if sums else 1)  # heading lines, and a blank line between two tables
        self._room = max(1, room if len(rows) <= room else room - 1)
        if len(rows) > self._room:
            top = self._top(rows)
            shown = rows[top : top + self._room]
            below.append(f"rows {top + 1} to {top + len(shown)} of {len(rows)}{KEYS if self._has_keys else ''}")
            rows = shown
        self._screen.show(self._tables(now, sums, rows, below))

    def _top(self, rows: Sequence[TallyRow], step: int = 0) -> int:
        """Return the index of the uppermost visible row."""
        top = 0 if self._uppermost is None else bisect_left(rows, self._uppermost, key=order)
        return max(0, min(top + step, len(rows) - self._room))

    def _tables(
        self, now: float, sums: Sequence[Sequence[str]], rows: Sequence[TallyRow], below: Sequence[str]
    ) -> list[Table]:
        decoder = self._decoder
        heads = HEADS if decoder is None else DECODED_HEADS
        lines = [cells(row, now) if decoder is None else cells_of(row, now, decoder) for row in rows]
        if not sums:
            return [Table(self._title(now), heads, lines, below)]
        return [Table(self._title(now), SUM_HEADS, sums), Table("", heads, lines, below)]

    def _sums(self, now: float) -> list[tuple[str, ...]]:
        """Return a row per type; the last one sums up the rest. Empty while no type has more than one station."""
        sums = self._tally.sums()
        if all(stations < 2 for _, stations in sums):
            return []
        if self._screen.is_terminal and len(sums) > MOST_SUMS:
            rest = TallyRow(OTHERS, None)
            for row, _ in sums[MOST_SUMS - 1 :]:
                rest.fold(row)
            sums = [*sums[: MOST_SUMS - 1], (rest, sum(stations for _, stations in sums[MOST_SUMS - 1 :]))]
        return [_sum_cells(row, stations, now) for row, stations in sums]

    def _notes(self, rows: Sequence[TallyRow]) -> list[str]:
        if self._decoder is not None:
            return list(notes([row for row in rows if row.bad], self._decoder))
        return [f"{whose(row)}: {doubt(row)}" for row in rows if row.implausible][:EXPLAINED]

    def _title(self, now: float) -> str:
        delivered = self._delivered
        parts = [
            time.strftime("%H:%M:%S"),
            self._listening.address,
            f"{self._tally.total} messages in {now - self._listening.started:.0f} s",
        ]
        if delivered.missed:
            parts.append(f"{delivered.missed} missed")
        if delivered.rubbish:
            parts.append(f"{delivered.rubbish} unreadable (last {delivered.sample.hex()})")
        if self._listening.silent_s:
            parts.append(f"silent for {self._listening.silent_s:.0f} s")
        return "  ".join(parts)


def _sum_cells(row: TallyRow, stations: int, now: float) -> tuple[str, ...]:
    rate = row.rate(now)
    return row.type or "(no name)", str(stations), str(row.count), "" if rate is None else f"{rate:.1f}"
