"""Map of the places where messages were sent, with their fates."""

from bisect import bisect_left
from collections import OrderedDict, defaultdict
from collections.abc import Iterator
from typing import NamedTuple

from drivers.message import Position
from firmware.meter.fate import Fate, Settled, Way

MOST = 20_000
MOST_POSITIONS = 65_536  # positions of messages whose fate is not known yet


class Spot(NamedTuple):
    """Message on the map.

    at_s        time of sending on the meter's time line.
    rssi_dbm    signal strength at the receiver; None if unknown.
    sender      latitude and longitude of the sender in degrees.
    receiver    the same of the receiver; None if unknown.
    is_guessed  the sender's position is interpolated, or is that of its station.
    """

    at_s: float
    way: Way
    station_id: int | None
    type: str
    is_lost: bool
    rssi_dbm: int | None
    sender: tuple[float, float]
    receiver: tuple[float, float] | None
    is_guessed: bool


class Track:
    """Positions of a station or sender over time, added in any order.

    Positions between two times are interpolated linearly.
    """

    def __init__(self) -> None:
        self._positions: dict[float, Position] = {}
        self._moments: list[float] | None = None

    def add(self, at_s: float, position: Position) -> None:
        if len(self._positions) < MOST:
            self._positions[at_s] = position
            self._moments = None

    def at(self, at_s: float) -> tuple[float, float] | None:
        """Return latitude and longitude in degrees at a time; None before the first and after the last known one."""
        if (exact := self._positions.get(at_s)) is not None:
            return _degrees(exact)
        moments = self._moments = sorted(self._positions) if self._moments is None else self._moments
        after = bisect_left(moments, at_s)
        if not 0 < after < len(moments):
            return None
        since, until = moments[after - 1], moments[after]
        share = (at_s - since) / (until - since)
        (a, b), (c, d) = _degrees(self._positions[since]), _degrees(self._positions[until])
        return a + share * (c - a), b + share * (d - b)


class Spots:
    """Collects positions and fates of up to MOST messages; `more` counts the rest."""

    def __init__(self) -> None:
        self.more = 0
        self._positions: OrderedDict[str, Position] = OrderedDict()
        self._kept: list[tuple[Settled, Position | None]] = []
        self._stations: defaultdict[str, Track] = defaultdict(Track)

    def note_message(self, digest: str, position: Position) -> None:
        """Note the position of a message's sender, by the message's digest."""
        self._positions[digest] = position
        if len(self._positions) > MOST_POSITIONS:
            self._positions.popitem(last=False)

    def note_station(self, name: str, at_s: float, position: Position) -> None:
        """Note a station's own position at a time."""
        self._stations[name].add(at_s, position)

    def add(self, one: Settled) -> None:
        if one.sent is None or one.fate not in (Fate.ARRIVED, Fate.LOST) or one.was is not None:
            return
        if len(self._kept) >= MOST:
            self.more += 1
            return
        self._kept.append((one, self._positions.get(one.sent.what.digest)))

    def __iter__(self) -> Iterator[Spot]:
        """Yield the messages whose position is known.

        The position is that in the message, that of its station, or between those of the sender's messages before and
        after.
        """
        told: defaultdict[tuple[str, int | None], Track] = defaultdict(Track)
        by_station: defaultdict[str, Track] = defaultdict(Track)
        for one, position in self._kept:
            if position is not None and one.sent is not None:
                told[one.way.sender, one.sent.what.station_id].add(one.sent.at_s, position)
                by_station[one.way.sender].add(one.sent.at_s, position)
        for one, position in self._kept:
            assert one.sent is not None
            at_s, what = one.sent.at_s, one.sent.what
            where = _degrees(position) if position is not None else self._stations[one.way.sender].at(at_s)
            where = where or told[one.way.sender, what.station_id].at(at_s)
            if where is not None:
                there = self._stations[one.way.receiver].at(at_s) or by_station[one.way.receiver].at(at_s)
                rssi_dbm = one.received.rssi_dbm if one.received is not None else None
                is_lost = one.fate is Fate.LOST
                yield Spot(at_s, one.way, what.station_id, what.type, is_lost, rssi_dbm, where, there, position is None)


def _degrees(position: Position) -> tuple[float, float]:
    return position.latitude / 1e7, position.longitude / 1e7
