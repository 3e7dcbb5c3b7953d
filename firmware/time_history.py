"""How time was: of each second of the last hour, and of each minute of the last day, in a fixed room."""

import math
from array import array
from base64 import b64encode
from typing import NamedTuple

SECONDS = 3600
MINUTES = 1440
MINUTE_S = 60
SHOWN = 120  # rows: twice the columns that a line of text has for them


class Row(NamedTuple):
    """One second; NaN where something is not known.

    its_s           of the pulse, or of the moment where there was none.
    offset_ns       true time less the system's clock.
    uncertainty_ns  of that, jitter_ns of pulses.
    phase_ns        of the oscillator against the truth, by the pulse alone: from some zero, and without steering.
    """

    its_s: float
    offset_ns: float
    uncertainty_ns: float
    jitter_ns: float
    phase_ns: float


class Rows:
    """The last so many rows: 40 octets each, from the start on."""

    def __init__(self, capacity: int) -> None:
        self._capacity = capacity
        self._width = len(Row._fields)
        self._values = array("d", bytes(8 * capacity * self._width))
        self._count = 0

    def add(self, row: Row) -> None:
        at = self._count % self._capacity * self._width
        self._values[at : at + self._width] = array("d", row)
        self._count += 1

    def octets(self, most: int = 0) -> bytes:
        """All of them, the oldest first, as doubles of this machine; of more than `most`, as many evenly apart."""
        kept = min(self._count, self._capacity)
        oldest = self._count - kept
        step = max(1, -(-kept // most)) if most else 1
        if step == 1:
            at = oldest % self._capacity * self._width
            return (self._values[at : kept * self._width] + self._values[:at]).tobytes()
        return b"".join(self._row(number) for number in range(oldest + (kept - 1) % step, self._count, step))

    def _row(self, number: int) -> bytes:
        at = number % self._capacity * self._width
        return self._values[at : at + self._width].tobytes()


class TimeHistory:
    """Less than 250 kB in all."""

    def __init__(self) -> None:
        self._seconds = Rows(SECONDS)
        self._minutes = Rows(MINUTES)
        self._minute: list[Row] = []

    def add(self, row: Row) -> None:
        """Rows come in the order of their seconds."""
        if self._minute and row.its_s // MINUTE_S != self._minute[0].its_s // MINUTE_S:
            self._minutes.add(_summed(self._minute))
            self._minute.clear()
        self._seconds.add(row)
        if len(self._minute) < MINUTE_S:  # of a second that is said twice, the first
            self._minute.append(row)

    def told(self) -> dict[str, object]:
        """As JSON: names of columns, and base64 of their doubles, row by row, little-endian as all our machines.

        It takes some milliseconds, in which nothing else is done: nobody is to ask for it again and again.
        """
        return _json(self._seconds.octets(), self._minutes.octets())

    def brief(self) -> dict[str, object]:
        """As told(), but SHOWN of the seconds, and no minutes."""
        return _json(self._seconds.octets(SHOWN), b"")


def _json(seconds: bytes, minutes: bytes) -> dict[str, object]:
    rows = {"seconds": b64encode(seconds).decode(), "minutes": b64encode(minutes).decode()}
    return {"columns": list(Row._fields), **rows}


def _summed(rows: list[Row]) -> Row:
    """A minute: offset and jitter on average, the largest uncertainty, the phase of the pulse that begins it.

    So phases are evenly apart, or missing.
    """
    minute_s = rows[0].its_s // MINUTE_S * MINUTE_S
    return Row(
        minute_s,
        _mean([row.offset_ns for row in rows]),
        max((row.uncertainty_ns for row in rows if not math.isnan(row.uncertainty_ns)), default=math.nan),
        _mean([row.jitter_ns for row in rows]),
        rows[0].phase_ns if rows[0].its_s == minute_s else math.nan,
    )


def _mean(values: list[float]) -> float:
    known = [value for value in values if not math.isnan(value)]
    return sum(known) / len(known) if known else math.nan
