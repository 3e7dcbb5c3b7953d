"""What a tap takes as a live table: a row for each type and station, and what could not be read below it."""

import time

from firmware.printable import clean
from firmware.tap.connection import Connection
from firmware.tap.counts import Counts, Taken
from firmware.user.received import Message
from firmware.user.table import Screen, Table, plain, width_of
from firmware.user.tally import HEADS, Row, Tally, cells

# A broker knows no signal strength.
_RSSI = HEADS.index(">rssi dBm")
TAP_HEADS = (*HEADS[:_RSSI], *HEADS[_RSSI + 1 :])
REDRAW_S = 0.5


class Display:
    """Draws often on a terminal; elsewhere the rows that changed, every second."""

    def __init__(self, screen: Screen, counts: Counts, connection: Connection) -> None:
        self._tally = Tally()
        self._screen = screen
        self._counts = counts
        self._connection = connection
        self._marked = self._drawn = time.monotonic()

    def add(self, message: Taken) -> None:
        self._tally.add(Message(message.type, message.pdu, None), time.monotonic())

    def idle(self) -> None:
        now = time.monotonic()
        is_due = now - self._marked >= 1.0
        if is_due or (self._screen.is_terminal and now - self._drawn >= REDRAW_S):
            self.draw(now)
        if is_due:
            self._tally.mark(now)
            self._marked = now

    def draw(self, now: float, is_last: bool = False) -> None:
        """Show the table; is_last: with all rows, whatever is shown into, of a tap that has left its broker."""
        title, notes = self._title(now, is_last), list(self._counts.complaints())
        beside = len(plain(Table(title, notes=notes), width_of(self._screen.stream)))
        rows = self._tally.rows(max(1, self._screen.height - beside - 2))  # the heads; those that have no room, as one
        if not (self._screen.is_terminal or is_last):
            rows = [row for row in rows if row.last >= self._marked]
        self._screen.show([Table(title, TAP_HEADS, [_cells(row, now) for row in rows], notes)])
        self._drawn = now

    def _title(self, now: float, is_last: bool) -> str:
        parts = [
            time.strftime("%H:%M:%S"),
            str(self._connection.broker),
            f"{self._tally.total} messages in {now - self._counts.started:.0f} s",
        ]
        if not (self._connection.is_up or is_last):
            parts.append("not connected")
        return "  ".join(parts)


def _cells(row: Row, now: float) -> tuple[str, ...]:
    usual = cells(row, now)
    return (*usual[:_RSSI], *usual[_RSSI + 1 :])


def line(message: Taken) -> str:
    """A message as `--lines` prints it."""
    seconds, rest = divmod(message.received_ns, 10**9)
    parts = (
        f"{time.strftime('%H:%M:%S', time.localtime(seconds))}.{rest // 10**6:03}",
        f"{message.type} of station {message.station_id}",
        f"{len(message.pdu)} octets",
        f"port {'-' if message.btp_port is None else message.btp_port}",
        message.source or "-",
        message.topic,
    )
    return clean("  ".join(parts))
