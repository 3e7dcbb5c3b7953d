"""Record of a station's time from its control socket, validated and parsed into rows."""

import math
import struct
from base64 import b64decode
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from firmware.clock.time_history import SecondRow
from firmware.untrusted import text

OCTETS = 8 * len(SecondRow._fields)
LATEST_S = 2.0**32  # ITS time of the year 2140; a peer's larger number is invalid


class Record(NamedTuple):
    """Rows of the last hour by second and of the last day by minute, the oldest first."""

    seconds: list[SecondRow]
    minutes: list[SecondRow]


def record(history: Mapping[str, object]) -> Record:
    """Return the record that a station sent; an empty record if it is malformed."""
    if history.get("columns") != list(SecondRow._fields):
        return Record([], [])
    return Record(_rows(text(history, "seconds")), _rows(text(history, "minutes")))


def plain(rows: Sequence[SecondRow]) -> list[dict[str, float | None]]:
    """Return rows as objects for JSON, with None in place of NaN."""
    return [{key: None if math.isnan(value) else value for key, value in row._asdict().items()} for row in rows]


def _rows(octets: str) -> list[SecondRow]:
    try:
        raw = b64decode(octets, validate=True)
    except ValueError:
        return []
    whole = raw[: len(raw) // OCTETS * OCTETS]
    rows = (SecondRow(*values) for values in struct.iter_unpack(f"<{len(SecondRow._fields)}d", whole))
    return [row for row in rows if 0 <= row.its_s < LATEST_S and not any(map(math.isinf, row))]
