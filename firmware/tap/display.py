"""Live table of a tap: a row for each type and station."""

import time

from firmware.client.received import Message
from firmware.client.show.table import Screen, Table, plain, width_of
from firmware.client.show.tally import HEADS, Tally, TallyRow, cells, folded
from firmware.printable import clean
from firmware.tap.connection import Connection
from firmware.tap.counts import Counts, Taken

# The column of signal strength is omitted: a broker does not know it.
_RSSI = HEADS.index(">dBm")
TAP_HEADS = (*HEADS[:_RSSI], *HEADS[_RSSI + 1 :])
REDRAW_S = 0.5


class Display:
    """Table of received messages.

    On a terminal it is redrawn every REDRAW_S; elsewhere the changed rows are printed once a second.
    """

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
        """Show the table; is_last: the final one, with all rows even if the output is not a terminal."""
        title, notes = self._title(now, is_last), list(self._counts.complaints())
        beside = len(plain(Table(title, notes=notes), width_of(self._screen.stream)))
        rows = folded(self._tally.rows(), max(1, self._screen.height - beside - 1))  # 1: the line of headings
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


def _cells(row: TallyRow, now: float) -> tuple[str, ...]:
    usual = cells(row, now)
    return (*usual[:_RSSI], *usual[_RSSI + 1 :])


def line(message: Taken) -> str:
    """Return a message as the line that `--lines` prints."""
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
