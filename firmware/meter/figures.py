"""Counts and measures of messages: for a direction, a row or all."""

import math
from collections import Counter
from collections.abc import Iterator
from typing import NamedTuple

from firmware.meter.age import Age, Gaps
from firmware.meter.delay import link, one_way
from firmware.meter.fate import Fate, Settled, Way
from firmware.meter.sample import MOST, Sample

MOST_OF_ROW = 2048  # numbers kept for each measure of a row
MOST_ROWS = 256
OTHERS = "(others)"


class Figures:
    """Counts and measures, computed from fates.

    counts            messages by fate, corrected by late reports.
    octets            octets of all sent messages.
    reordered         messages that arrived after a later one.
    repeats           messages of which several copies may have been under way.
    one_way_us        delay from acceptance to reception.
    one_way_doubt_us  uncertainty of one_way_us.
    link_us           delay from departure to reception.
    doubt_us          uncertainty of link_us.
    queue_us          time in the queue before departure.
    send_us           time that sending took.
    """

    def __init__(self, most: int = MOST) -> None:
        self.counts: Counter[Fate] = Counter()
        self._known = self._known_lost = 0
        self.octets = 0
        self.reordered = 0
        self.repeats = 0
        self.one_way_us, self.one_way_doubt_us = Sample(most), Sample(most)
        self.link_us, self.doubt_us = Sample(most), Sample(most)
        self.queue_us, self.send_us = Sample(most), Sample(most)
        self.rssi_dbm = Sample(most)
        self.gaps = Gaps(most)
        self.age = Age(most)
        # Times at which the last message was sent, and at which the last one arrived.
        self._sent_s = self._came_s = -math.inf

    @property
    def open_s(self) -> float:
        """Seconds from the last reception to the last sent message: a gap at the end that no reception has ended."""
        return max(0.0, self._sent_s - self._came_s) if math.isfinite(self._came_s) else 0.0

    @property
    def sent(self) -> int:
        return sum(self.counts[fate] for fate in (Fate.ARRIVED, Fate.LOST, Fate.LATE, Fate.UNSEEN))

    @property
    def arrived(self) -> int:
        """Number of messages that arrived, in time or late."""
        return self.counts[Fate.ARRIVED] + self.counts[Fate.LATE]

    @property
    def lost(self) -> int:
        """Number of messages that have not arrived so far."""
        return self.counts[Fate.LOST]

    @property
    def loss(self) -> float | None:
        """Share of lost messages among those sent while all reports were received; None without such messages."""
        return self._known_lost / self._known if self._known else None

    def add(self, one: Settled) -> None:
        self.counts[one.fate] += 1
        if one.was is not None:
            self.counts[one.was] -= 1
        if one.sent is not None and not one.is_unheard:
            self._known += one.was in (None, Fate.STRANGE)
            self._known_lost += (one.fate is Fate.LOST) - (one.was is Fate.LOST)
        if one.sent is not None and one.was in (None, Fate.STRANGE):
            self.octets += one.sent.what.octets
            self.queue_us.add(one.sent.queue_ns / 1000)
            self.send_us.add(one.sent.send_ns / 1000)
        if one.sent is not None and one.fate is not Fate.UNSEEN:
            self._sent_s = max(self._sent_s, one.sent.at_s)
        received = one.received
        if received is None or one.fate not in (Fate.ARRIVED, Fate.LATE):
            return
        self.reordered += one.is_reordered
        self.repeats += one.is_repeat
        self.gaps.add(received.received_ns)
        self._came_s = max(self._came_s, received.at_s)
        if received.rssi_dbm is not None:
            self.rssi_dbm.add(received.rssi_dbm)
        if one.sent is None or one.is_repeat or (delay := one_way(one.sent, received)) is None:
            return
        self.one_way_us.add(delay.ns / 1000)
        self.one_way_doubt_us.add(delay.uncertainty_ns / 1000)
        self.age.add(received.received_ns, delay.ns)
        alone = link(one.sent, received)
        if alone is not None:
            self.link_us.add(alone.ns / 1000)
            self.doubt_us.add(alone.uncertainty_ns / 1000)


class Key(NamedTuple):
    """Direction, type and station of a row."""

    way: Way
    type: str
    station_id: int | None


class Rows:
    """Figures by direction, type and station. Beyond the limit of rows, all others of a direction share one row."""

    def __init__(self, most: int = MOST_ROWS) -> None:
        self._most = most
        self._rows: dict[Key, Figures] = {}

    def add(self, one: Settled) -> None:
        event = one.sent or one.received
        if event is None or one.fate is Fate.STRANGE:
            return
        key = Key(one.way, event.what.type, event.what.station_id)
        if key not in self._rows and len(self._rows) >= self._most:
            key = Key(one.way, OTHERS, None)
        row = self._rows.get(key)
        if row is None:
            row = self._rows[key] = Figures(MOST_OF_ROW)
        row.add(one if one.was is not Fate.STRANGE else one._replace(was=None))

    def __iter__(self) -> Iterator[tuple[Key, Figures]]:
        yield from sorted(self._rows.items(), key=lambda item: (item[0].way, item[0].type, item[0].station_id or 0))
