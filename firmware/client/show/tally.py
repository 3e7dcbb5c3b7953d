"""Tally: counts received messages per type and station, in bounded memory."""

from collections import Counter, deque
from collections.abc import Sequence

from firmware import topics
from firmware.client.received import Heard
from firmware.client.show.table import span

# Limit of rows: 200 stations around a busy junction, each with CAM, CPM, DENM and others. Beyond it, the row silent for
# longest is added to `others`.
MAX_ROWS = 1024
MAX_TYPES = 32  # limit of type names, which a station may choose freely; further types are counted as `others`
# Number of marks over which a rate is averaged. The caller sets one mark a second, so that a DENM per second shows as
# 1.0.
MARKS = 5
SHORTEST_S = 1.0  # seconds; a rate over less time would be meaningless
OTHERS = "others"
# Priorities of the known types. A type that users define has no known priority and is sorted last.
PRIORITIES = {row.name: row.priority for row in topics.ROWS}
LAST = 8


class TallyRow:
    """Counts of the messages of one type from one station.

    pdu          PDU of the last message.
    source       sender of the last message: MAC address, or name at a broker; empty if unknown.
    bad          number of messages that do not decode.
    bad_pdu      PDU of the last message that does not decode.
    implausible  number of messages that the station has marked as implausible.
    reasons      reasons of the last such mark.
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
        "source",
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
        self.source = ""
        self.bad = 0
        self.bad_pdu = b""
        self.implausible = 0
        self.reasons: tuple[str, ...] = ()
        self._marks: deque[tuple[float, int]] = deque(maxlen=MARKS)

    def add(self, message: Heard, now: float, is_bad: bool) -> None:
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
        self.rssi_dbm = message.rssi_dbm
        self.source = message.source
        self.count += 1
        self.last = now

    def fold(self, row: "TallyRow") -> None:
        """Add the counts of a row that is removed from the table."""
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
        """Return messages per second since the oldest mark; None if that is less than SHORTEST_S ago."""
        if not self._marks or now - self._marks[0][0] < SHORTEST_S:
            return None
        then, count = self._marks[0]
        return (self.count - count) / (now - then)


class Tally:
    """Message counts by type and station. Beyond the limit, the row silent for longest is folded into `others`."""

    def __init__(self, most: int = MAX_ROWS) -> None:
        self.others = TallyRow("", OTHERS)
        self.total = 0
        self._most = most
        self._rows: dict[tuple[str, int | None], TallyRow] = {}  # in order of their last message
        self._sums: dict[str, TallyRow] = {}

    def add(self, message: Heard, now: float, is_bad: bool = False) -> None:
        """Count a message.

        now     monotonic time in seconds.
        is_bad  the message does not decode.
        """
        key = (message.type, message.station)
        row = self._rows.pop(key, None)
        if row is None:
            if len(self._rows) >= self._most:
                self.others.fold(self._rows.pop(next(iter(self._rows))))
            row = TallyRow(*key)
            row.mark(now)
        self._rows[key] = row
        row.add(message, now, is_bad)
        self._sum_of(message.type, now).add(message, now, is_bad)
        self.total += 1

    def _sum_of(self, kind: str, now: float) -> TallyRow:
        name = kind if kind in self._sums or len(self._sums) < MAX_TYPES else OTHERS
        if name not in self._sums:
            self._sums[name] = TallyRow(name, None)
            self._sums[name].mark(now)
        return self._sums[name]

    def mark(self, now: float) -> None:
        """Set a mark in all rows, from which rates are counted; the caller does so once a second."""
        for row in (*self._rows.values(), *self._sums.values()):
            row.mark(now)
        self.others.mark(now)

    def count(self, kind: str, station: int) -> int:
        """Return the number of messages of a type from a station; 0 if the station has no row."""
        row = self._rows.get((kind, station))
        return row.count if row is not None else 0

    def rows(self) -> list[TallyRow]:
        """Return all rows by priority, type and station; the row of `others` comes last.

        The order depends only on type and station, so a row keeps its place until another one is added or removed.
        """
        shown = sorted(self._rows.values(), key=order)
        return [*shown, self.others] if self.others.count else shown

    def sums(self) -> list[tuple[TallyRow, int]]:
        """Return the sum of each type by priority, with the number of its stations that have a row."""
        stations = Counter(kind if kind in self._sums else OTHERS for kind, _ in self._rows)
        return [(row, stations[row.type]) for row in sorted(self._sums.values(), key=order)]


def order(row: TallyRow) -> tuple[int, str, int]:
    """Return the sort key of a row: priority, type, station; the row of `others` is last."""
    if row.station == OTHERS:
        return LAST + 1, "", 0
    return PRIORITIES.get(row.type, LAST), row.type, row.station if isinstance(row.station, int) else -1


def folded(rows: Sequence[TallyRow], most: int) -> list[TallyRow]:
    """Return at most `most` rows: the last ones are folded into one row with their sum."""
    if len(rows) <= most:
        return list(rows)
    rest = TallyRow("", OTHERS)
    for row in rows[most - 1 :]:
        rest.fold(row)
    return [*rows[: most - 1], rest]


def doubt(row: TallyRow) -> str:
    """Return the number of implausible messages of a row and the last reasons; empty without any."""
    return f"! {row.implausible} implausible: {', '.join(row.reasons)}" if row.implausible else ""


HEADS = ("type", ">station", ">count", ">per s", ">octets", ">dBm", ">ago")


def cells(row: TallyRow, now: float) -> tuple[str, ...]:
    """Return the cells of a row for a Table with HEADS; now: monotonic time in seconds."""
    rate = row.rate(now)
    sizes = f"{row.shortest}" if row.shortest == row.longest else f"{row.shortest}..{row.longest}"
    return (
        row.type or ("" if row.station == OTHERS else "(no name)"),
        "-" if row.station is None else str(row.station),
        str(row.count),
        "" if rate is None else f"{rate:.1f}",
        sizes,
        str(row.rssi_dbm or "-"),
        span(now - row.last),
    )
