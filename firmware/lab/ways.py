"""Counts by interface of messages that two stations exchanged over several interfaces."""

import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from firmware.client import client
from firmware.client.show.table import Table
from firmware.untrusted import listed, number, within

PATIENCE_S = 5.0  # a window of 2 s must pass until messages of one interface alone are counted
LOOK_S = 0.1


class Way(NamedTuple):
    """Counts of one interface of one station.

    first    messages that this interface delivered first and another one later.
    lead_ms  mean lead over the other interface in ms.
    alone    messages that only this interface delivered.
    """

    station: str
    interface: str
    first: int
    lead_ms: float
    alone: int


def ways(station: str, control: Path, delivered: int) -> list[Way]:
    """Return the counts of a station by interface.

    Waits until all delivered messages are classified as paired or alone, at most PATIENCE_S.
    """
    deadline = time.monotonic() + PATIENCE_S
    while True:
        status = client.station_status(control)
        found = list(_ways(station, status))
        if sum(way.first + way.alone for way in found) >= delivered or time.monotonic() > deadline:
            return found
        time.sleep(LOOK_S)  # this waits in the command's own process, not in a station's loop


def _ways(station: str, status: Mapping[str, object]) -> Iterator[Way]:
    duplicates = within(status, "duplicates")
    first, lead = within(duplicates, "first"), within(duplicates, "lead_ms")
    alone = [within(path, "alone") for path in listed(duplicates, "paths")]
    for name in within(status, "interfaces"):
        count = sum(number(path, name) for path in alone)
        yield Way(station, name, round(number(first, name)), number(lead, name), round(count))


def table(found: Sequence[Way]) -> Table:
    heads = ("station", "interface", ">first", ">lead ms", ">alone")
    rows = [(way.station, way.interface, str(way.first), f"{way.lead_ms:.1f}", str(way.alone)) for way in found]
    return Table("Interface that was first, and messages of one interface alone", heads, rows)
