"""By which way the messages came that two stations have exchanged by more than one."""

import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from firmware.user import client
from firmware.user.table import Table
from firmware.user.untrusted import listed, number, within

PATIENCE_S = 5.0  # a window of 2 s passes until it is known what one way alone has brought
LOOK_S = 0.1


class Way(NamedTuple):
    """One interface of one station.

    first    messages that it was the first to bring, of those that another has brought too.
    lead_ms  by how much, on average.
    alone    messages that no other has brought.
    """

    station: str
    interface: str
    first: int
    lead_ms: float
    alone: int


def ways(station: str, control: Path, delivered: int) -> list[Way]:
    """Those of a station that has delivered so many messages, as soon as all are known to be paired or alone."""
    deadline = time.monotonic() + PATIENCE_S
    while True:
        status = client.station_status(control)
        found = list(_ways(station, status))
        if sum(way.first + way.alone for way in found) >= delivered or time.monotonic() > deadline:
            return found
        time.sleep(LOOK_S)  # this is a command's own process, no station's loop


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
    return Table("Which way was first, and what one way alone has brought", heads, rows)
