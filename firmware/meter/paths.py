"""Messages that leave by several interfaces: which way was first, by how much, what one alone has brought, the gain."""

from collections import OrderedDict
from typing import NamedTuple

from firmware.meter.delay import one_way
from firmware.meter.matching import Fate, Settled, Way
from firmware.meter.sample import Sample

# Messages of which not all ways are known: some seconds of four interfaces with a full channel each.
MOST_OPEN = 65_536


class Between(NamedTuple):
    """From which station to which."""

    sender: str
    receiver: str


class _Copy(NamedTuple):
    """A message with its ends: its k-th copy by one way is its k-th by another."""

    between: Between
    digest: str
    copy: int


class PathFigures:
    """One way beside the others.

    sent, arrived  of messages that left by another way too.
    first, lead_us  how often it was the first of several, and by how much.
    alone          that no other way has brought.
    """

    def __init__(self) -> None:
        self.sent = self.arrived = self.first = self.alone = 0
        self.lead_us = Sample()
        self.one_way_us = Sample()

    @property
    def delivery(self) -> float | None:
        return self.arrived / self.sent if self.sent else None


class Both:
    """All ways between two stations together.

    sent     messages that left by several ways. arrived: by one of them at least.
    one_way_us  of the first that came.
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
        """Share that arrives by all ways together less that by the best one of them."""
        shares = [one.delivery for one in self.ways.values() if one.delivery is not None]
        return self.delivery - max(shares) if self.delivery is not None and shares else None


class Paths:
    """Takes fates of all ways; a message is judged when nothing more can be heard of it.

    hold_s  how long after its first word.
    """

    def __init__(self, hold_s: float) -> None:
        self.both: dict[Between, Both] = {}
        self._hold_s = hold_s
        self._open: OrderedDict[_Copy, tuple[float, list[Settled]]] = OrderedDict()

    def add(self, one: Settled, now_s: float) -> None:
        if one.sent is None or one.fate is Fate.UNSEEN or one.was is not None or one.way.is_round_trip:
            return
        key = _Copy(Between(one.way.sender, one.way.receiver), one.sent.what.digest, one.copy)
        self._open.setdefault(key, (now_s, []))[1].append(one)
        if len(self._open) > MOST_OPEN:
            self._judge(*self._open.popitem(last=False))

    def settle(self, now_s: float) -> None:
        while self._open:
            key, kept = next(iter(self._open.items()))
            if kept[0] + self._hold_s > now_s:
                return
            del self._open[key]
            self._judge(key, kept)

    def _judge(self, key: _Copy, kept: tuple[float, list[Settled]]) -> None:
        ways = kept[1]
        if len(ways) < 2:
            return
        both = self.both.setdefault(key.between, Both())
        both.sent += 1
        came = sorted(
            (one for one in ways if one.received is not None),
            key=lambda one: one.received.received_ns,  # type: ignore[union-attr]
        )
        for one in ways:
            figures = both.ways.setdefault(one.way, PathFigures())
            figures.sent += 1
            if one.received is not None:
                figures.arrived += 1
                _note(figures.one_way_us, one)
        if not came:
            return
        both.arrived += 1
        _note(both.one_way_us, came[0])
        first = both.ways[came[0].way]
        if len(came) == 1:
            first.alone += 1
            return
        first.first += 1
        assert came[0].received is not None
        assert came[1].received is not None
        first.lead_us.add((came[1].received.received_ns - came[0].received.received_ns) / 1000)


def _note(sample: Sample, one: Settled) -> None:
    if one.sent is None or one.received is None or one.is_repeat:
        return
    if (delay := one_way(one.sent, one.received)) is not None:
        sample.add(delay.ns / 1000)
