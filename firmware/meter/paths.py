"""Messages sent by several interfaces: first arrival, lead, exclusive deliveries, gain."""

from collections import OrderedDict
from typing import NamedTuple

from firmware.meter.delay import one_way
from firmware.meter.fate import Fate, Settled, Way
from firmware.meter.matching import LATEST_S
from firmware.meter.sample import Sample

# Limit of undecided messages: some seconds of four interfaces with a full channel each.
MOST_OPEN = 65_536


class Between(NamedTuple):
    """Sending and receiving station."""

    sender: str
    receiver: str


class _Copy(NamedTuple):
    """One message between two stations: copies with equal numbers in several directions belong to the same sending."""

    between: Between
    digest: str
    copy: int


class PathFigures:
    """Figures of one direction compared with the others.

    sent     messages that also left in another direction.
    arrived  those of them that arrived.
    first    number of messages that it delivered before any other.
    lead_us  lead of these messages.
    alone    messages that no other direction delivered.
    """

    def __init__(self) -> None:
        self.sent = self.arrived = self.first = self.alone = 0
        self.lead_us = Sample()
        self.one_way_us = Sample()

    @property
    def delivery(self) -> float | None:
        return self.arrived / self.sent if self.sent else None


class Both:
    """Figures of all directions between two stations together.

    sent        messages that left in several directions.
    arrived     messages that at least one direction delivered.
    one_way_us  delay of the first copy to arrive.
    ways        figures of each direction.
    """

    def __init__(self) -> None:
        self.sent = self.arrived = 0
        self.one_way_us = Sample()
        self.ways: dict[Way, PathFigures] = {}

    @property
    def delivery(self) -> float | None:
        return self.arrived / self.sent if self.sent else None

    @property
    def gain(self) -> float | None:
        """Share delivered by all directions together, minus the share of the best one; None if unknown."""
        shares = [one.delivery for one in self.ways.values() if one.delivery is not None]
        return self.delivery - max(shares) if self.delivery is not None and shares else None


class Paths:
    """Combines the fates of all directions. A message is judged after hold_s and corrected by late reports.

    hold_s  seconds from its first report until it is judged.
    """

    def __init__(self, hold_s: float) -> None:
        self.both: dict[Between, Both] = {}
        self._hold_s = hold_s
        self._open: OrderedDict[_Copy, _Kept] = OrderedDict()
        # Judged messages that at least one direction has not delivered.
        self._lossy: OrderedDict[_Copy, _Kept] = OrderedDict()

    def add(self, one: Settled, now_s: float) -> None:
        if one.sent is None or one.fate is Fate.UNSEEN or one.way.is_round_trip:
            return
        key = _Copy(Between(one.way.sender, one.way.receiver), one.sent.what.digest, one.copy)
        if one.was is Fate.LOST and key not in self._open:
            self._correct(key, one)
            return
        kept = self._open.setdefault(key, _Kept(now_s, {}))
        kept.ways[one.way] = one
        if len(self._open) > MOST_OPEN:
            self._judge(*self._open.popitem(last=False))

    def settle(self, now_s: float) -> None:
        while self._open and next(iter(self._open.values())).since_s + self._hold_s <= now_s:
            self._judge(*self._open.popitem(last=False))
        while self._lossy and next(iter(self._lossy.values())).since_s + LATEST_S < now_s:
            self._lossy.popitem(last=False)

    def _judge(self, key: _Copy, kept: "_Kept") -> None:
        if len(kept.ways) < 2:
            return
        both = self.both.setdefault(key.between, Both())
        both.sent += 1
        came = kept.came()
        for one in kept.ways.values():
            figures = both.ways.setdefault(one.way, PathFigures())
            figures.sent += 1
            if one.received is not None:
                figures.arrived += 1
                _note(figures.one_way_us, one)
        if len(came) < len(kept.ways):
            self._lossy[key] = kept
            if len(self._lossy) > MOST_OPEN:
                self._lossy.popitem(last=False)
        if came:
            both.arrived += 1
            _note(both.one_way_us, came[0])
            _first(both, came, 1)

    def _correct(self, key: _Copy, one: Settled) -> None:
        """Correct a judged message that another direction has delivered late."""
        kept = self._lossy.get(key)
        if kept is None or one.way not in kept.ways:
            return
        both, before = self.both[key.between], kept.came()
        kept.ways[one.way] = one
        both.ways[one.way].arrived += 1
        _note(both.ways[one.way].one_way_us, one)
        if before:
            _first(both, before, -1)
        else:
            both.arrived += 1
            _note(both.one_way_us, one)
        _first(both, kept.came(), 1)


class _Kept(NamedTuple):
    """Message with the time of its first report and its fates by direction."""

    since_s: float
    ways: dict[Way, Settled]

    def came(self) -> list[Settled]:
        """Return the fates with a reception, in order of reception."""
        found = [(one.received.received_ns, one) for one in self.ways.values() if one.received is not None]
        return [one for _, one in sorted(found, key=lambda pair: pair[0])]


def _first(both: Both, came: list[Settled], step: int) -> None:
    """Add or subtract (step 1 or -1) a first or exclusive delivery. Leads already counted are kept."""
    figures = both.ways[came[0].way]
    if len(came) == 1:
        figures.alone += step
        return
    figures.first += step
    assert came[0].received is not None
    assert came[1].received is not None
    if step > 0:
        figures.lead_us.add((came[1].received.received_ns - came[0].received.received_ns) / 1000)


def _note(sample: Sample, one: Settled) -> None:
    if one.sent is None or one.received is None or one.is_repeat:
        return
    if (delay := one_way(one.sent, one.received)) is not None:
        sample.add(delay.ns / 1000)
