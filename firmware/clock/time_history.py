"""History of station time: rows for the seconds of an hour and the minutes of a day."""

import math
from array import array
from base64 import b64encode
from collections.abc import Sequence
from typing import NamedTuple

SECONDS = 3600
MINUTES = 1440
MINUTE_S = 60
SHOWN = 120  # number of rows in the short history; twice the columns of a line of text


class SecondRow(NamedTuple):
    """Row of the history for one second; unknown values are NaN.

    its_s           ITS time in seconds, of the pulse if the second has one.
    offset_ns       true time minus the system clock.
    uncertainty_ns  uncertainty of the offset.
    jitter_ns       jitter of pulses.
    phase_ns        phase of the unsteered oscillator against the pulses, from an arbitrary zero.
    """

    its_s: float
    offset_ns: float
    uncertainty_ns: float
    jitter_ns: float
    phase_ns: float


class Rows:
    """Ring buffer of rows of 40 octets each, allocated at construction."""

    def __init__(self, capacity: int) -> None:
        self._capacity = capacity
        self._width = len(SecondRow._fields)
        self._values = array("d", bytes(8 * capacity * self._width))
        self._count = 0

    def add(self, row: SecondRow) -> None:
        at = self._count % self._capacity * self._width
        self._values[at : at + self._width] = array("d", row)
        self._count += 1

    def octets(self, most: int = 0) -> bytes:
        """Return the rows as doubles, the oldest first.

        most  largest number of rows, which are then evenly spaced; 0: all rows.
        """
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
    """History of station time: a ring of seconds and a ring of minutes, together less than 250 kB."""

    def __init__(self) -> None:
        self._seconds = Rows(SECONDS)
        self._minutes = Rows(MINUTES)
        self._minute: list[SecondRow] = []

    def add(self, row: SecondRow) -> None:
        """Add the row of a second. The caller adds rows in the order of their seconds."""
        if self._minute and row.its_s // MINUTE_S != self._minute[0].its_s // MINUTE_S:
            self._minutes.add(_summed(self._minute))
            self._minute.clear()
        self._seconds.add(row)
        if len(self._minute) < MINUTE_S:  # a minute has no more rows, even if a second has two
            self._minute.append(row)

    def told(self) -> dict[str, object]:
        """Return the whole history for JSON.

        The object has the names of the columns. The values are base64 of little-endian doubles, row by row. This blocks
        the loop for some milliseconds, so it is called only on request.
        """
        return _json(self._seconds.octets(), self._minutes.octets())

    def brief(self) -> dict[str, object]:
        """Return a short history, in the format of told(): at most SHOWN seconds and no minutes."""
        return _json(self._seconds.octets(SHOWN), b"")


def _json(seconds: bytes, minutes: bytes) -> dict[str, object]:
    rows = {"seconds": b64encode(seconds).decode(), "minutes": b64encode(minutes).decode()}
    return {"columns": list(SecondRow._fields), **rows}


def _summed(rows: list[SecondRow]) -> SecondRow:
    """Return the row of a minute: mean offset and jitter, largest uncertainty, phase at its first second.

    The phase is NaN if the first second is missing, so that all known phases are evenly spaced.
    """
    minute_s = rows[0].its_s // MINUTE_S * MINUTE_S
    return SecondRow(
        minute_s,
        mean([row.offset_ns for row in rows]),
        max((row.uncertainty_ns for row in rows if not math.isnan(row.uncertainty_ns)), default=math.nan),
        mean([row.jitter_ns for row in rows]),
        rows[0].phase_ns if rows[0].its_s == minute_s else math.nan,
    )


def mean(values: Sequence[float]) -> float:
    """Return the mean of the values that are not NaN; NaN without such values."""
    known = [value for value in values if not math.isnan(value)]
    return sum(known) / len(known) if known else math.nan
