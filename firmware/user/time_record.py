"""The history of a station's time as its control socket gives it, read without trust: rows of numbers."""

import math
import struct
from base64 import b64decode
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from firmware.time_history import Row
from firmware.user.untrusted import text

OCTETS = 8 * len(Row._fields)
LATEST_S = 2.0**32  # of ITS time, in 2140: the number of a peer that is no second


class Record(NamedTuple):
    """Each second of the last hour, each minute of the last day; the oldest first."""

    seconds: list[Row]
    minutes: list[Row]


def record(history: Mapping[str, object]) -> Record:
    """What a station has kept; of another form: nothing."""
    if history.get("columns") != list(Row._fields):
        return Record([], [])
    return Record(_rows(text(history, "seconds")), _rows(text(history, "minutes")))


def plain(rows: Sequence[Row]) -> list[dict[str, float | None]]:
    """For JSON, which has no NaN."""
    return [{key: None if math.isnan(value) else value for key, value in row._asdict().items()} for row in rows]


def _rows(octets: str) -> list[Row]:
    try:
        raw = b64decode(octets, validate=True)
    except ValueError:
        return []
    whole = raw[: len(raw) // OCTETS * OCTETS]
    rows = (Row(*values) for values in struct.iter_unpack(f"<{len(Row._fields)}d", whole))
    return [row for row in rows if 0 <= row.its_s < LATEST_S and not any(map(math.isinf, row))]
