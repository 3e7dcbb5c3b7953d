"""Counts received messages per type and station, in bounded memory whoever sends them."""

from collections import deque

from firmware.user.received import Message

# Stations in range of a busy junction: about 200. Those silent longest give their place, not their count.
MAX_ROWS = 256
# Rates are means over this many marks, which the caller sets once a second: a DENM a second shows as 1.0.
MARKS = 5
SHORTEST_S = 1.0  # the burst of a millisecond has no rate
OTHERS = "others"


class Row:
    """The messages of one type from one station.

    pdu  the last one.
    bad  how many of them do not decode; bad_pdu is the last of those.
    implausible  how many the station has marked; reasons are those of the last.
    """

    __slots__ = (
        "_marks",
        "bad",
        "bad_pdu",
        "count",
        "implausible",
        "last",
        "longest",
        "pdu",
        "reasons",
        "rssi_dbm",
        "shortest",
        "station",
        "type",
    )

    def __init__(self, kind: str, station: int | str | None) -> None:
        self.type = kind
        self.station = station
        self.count = 0
        self.last = 0.0
        self.shortest = 0
        self.longest = 0
        self.rssi_dbm: int | None = None
        self.pdu = b""
        self.bad = 0
        self.bad_pdu = b""
        self.implausible = 0
        self.reasons: tuple[str, ...] = ()
        self._marks: deque[tuple[float, int]] = deque(maxlen=MARKS)

    def add(self, message: Message, now: float, is_bad: bool) -> None:
        self.pdu = message.pdu
        if is_bad:
            self.bad += 1
            self.bad_pdu = message.pdu
        if message.implausible:
            self.implausible += 1
            self.reasons = message.implausible
        octets = len(message.pdu)
        self.shortest = min(self.shortest, octets) if self.count else octets
        self.longest = max(self.longest, octets)
        if message.raw is not None:
            self.rssi_dbm = message.raw.rx.rssi_dbm
        self.count += 1
        self.last = now

    def fold(self, row: "Row") -> None:
        """Take over the count of a row that leaves the table."""
        self.shortest = min(self.shortest, row.shortest) if self.count else row.shortest
        self.longest = max(self.longest, row.longest)
        self.count += row.count
        self.bad += row.bad
        self.implausible += row.implausible
        self.reasons = row.reasons or self.reasons
        self.last = max(self.last, row.last)

    def mark(self, now: float) -> None:
        self._marks.append((now, self.count))

    def rate(self, now: float) -> float | None:
        """Messages per second since the oldest mark; None before that is SHORTEST_S ago."""
        if not self._marks or now - self._marks[0][0] < SHORTEST_S:
            return None
        then, count = self._marks[0]
        return (self.count - count) / (now - then)


class Tally:
    """Rows by type and station, the longest silent one folded into `others` when there are too many."""

    def __init__(self, most: int = MAX_ROWS) -> None:
        self.others = Row("", OTHERS)
        self.total = 0
        self._most = most
        self._rows: dict[tuple[str, int | None], Row] = {}  # in the order of their last message

    def add(self, message: Message, now: float, is_bad: bool = False) -> None:
        """Count a message; now is monotonic; is_bad: it does not decode."""
        key = (message.type, message.station_id)
        row = self._rows.pop(key, None)
        if row is None:
            if len(self._rows) >= self._most:
                self.others.fold(self._rows.pop(next(iter(self._rows))))
            row = Row(*key)
            row.mark(now)
        self._rows[key] = row
        row.add(message, now, is_bad)
        self.total += 1

    def mark(self, now: float) -> None:
        """Once a second: where rates are counted from."""
        for row in self._rows.values():
            row.mark(now)
        self.others.mark(now)

    def count(self, kind: str, station: int) -> int:
        """Messages of a type from a station, 0 when it is not in the table."""
        row = self._rows.get((kind, station))
        return row.count if row is not None else 0

    def rows(self, most: int = MAX_ROWS) -> list[Row]:
        """At most so many rows, those heard last, by type and station; the rest folded into one."""
        shown = list(self._rows.values())
        hidden = shown[: max(0, len(shown) - most)]
        shown = sorted(shown[len(hidden) :], key=lambda row: (row.type, -1 if row.station is None else row.station))
        if not hidden and not self.others.count:
            return shown
        rest = Row("", OTHERS)
        for row in (self.others, *hidden):
            if row.count:
                rest.fold(row)
        return [*shown, rest]


def doubt(row: Row) -> str:
    """How many messages of a row are implausible, and why the last one is; empty for none."""
    return f"! {row.implausible} implausible: {', '.join(row.reasons)}" if row.implausible else ""


HEADS = ("type", ">station", ">count", ">per s", ">octets", ">rssi dBm", ">ago")


def cells(row: Row, now: float) -> tuple[str, ...]:
    """What a Table with HEADS shows of a row; now is monotonic."""
    rate = row.rate(now)
    sizes = f"{row.shortest}" if row.shortest == row.longest else f"{row.shortest}..{row.longest}"
    return (
        row.type or "(no name)",
        "-" if row.station is None else str(row.station),
        str(row.count),
        "" if rate is None else f"{rate:.1f}",
        sizes,
        str(row.rssi_dbm or "-"),
        f"{now - row.last:.1f} s",
    )
