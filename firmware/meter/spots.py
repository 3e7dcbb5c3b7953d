"""Where messages were sent from, and what became of them there: a map."""

from bisect import bisect_left
from collections import OrderedDict, defaultdict
from collections.abc import Iterator
from typing import NamedTuple

from drivers.message import Position
from firmware.meter.fate import Fate, Settled, Way

MOST = 20_000
MOST_PLACES = 65_536  # of messages whose fate is not known yet


class Spot(NamedTuple):
    """A message: latitude and longitude in degrees of its sender, and of its receiver where that is known.

    is_guessed  the sender's: between where it was before and after.
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
    """Where something was: moments in any order, and between two of them a straight line."""

    def __init__(self) -> None:
        self._places: dict[float, Position] = {}
        self._moments: list[float] | None = None

    def add(self, at_s: float, place: Position) -> None:
        if len(self._places) < MOST:
            self._places[at_s] = place
            self._moments = None

    def at(self, at_s: float) -> tuple[float, float] | None:
        """Degrees; None before the first moment and after the last."""
        if (exact := self._places.get(at_s)) is not None:
            return _degrees(exact)
        moments = self._moments = sorted(self._places) if self._moments is None else self._moments
        after = bisect_left(moments, at_s)
        if not 0 < after < len(moments):
            return None
        since, until = moments[after - 1], moments[after]
        share = (at_s - since) / (until - since)
        (a, b), (c, d) = _degrees(self._places[since]), _degrees(self._places[until])
        return a + share * (c - a), b + share * (d - b)


class Spots:
    """Takes places as they become known, and fates; the first MOST of them, and `more` counts the rest."""

    def __init__(self) -> None:
        self.more = 0
        self._places: OrderedDict[str, Position] = OrderedDict()
        self._kept: list[tuple[Settled, Position | None]] = []
        self._stations: defaultdict[str, Track] = defaultdict(Track)

    def place(self, digest: str, place: Position) -> None:
        """Where a message was made, as it or its interface says."""
        self._places[digest] = place
        if len(self._places) > MOST_PLACES:
            self._places.popitem(last=False)

    def station(self, name: str, at_s: float, place: Position) -> None:
        """Where a station is, as it says itself."""
        self._stations[name].add(at_s, place)

    def add(self, one: Settled) -> None:
        if one.sent is None or one.fate not in (Fate.ARRIVED, Fate.LOST) or one.was is not None:
            return
        if len(self._kept) >= MOST:
            self.more += 1
            return
        self._kept.append((one, self._places.get(one.sent.what.digest)))

    def __iter__(self) -> Iterator[Spot]:
        """Those whose sender's place is known: by the message, by the station, or by its messages before and after."""
        told: defaultdict[tuple[str, int | None], Track] = defaultdict(Track)
        by_station: defaultdict[str, Track] = defaultdict(Track)
        for one, place in self._kept:
            if place is not None and one.sent is not None:
                told[one.way.sender, one.sent.what.station_id].add(one.sent.at_s, place)
                by_station[one.way.sender].add(one.sent.at_s, place)
        for one, place in self._kept:
            assert one.sent is not None
            at_s, what = one.sent.at_s, one.sent.what
            where = _degrees(place) if place is not None else self._stations[one.way.sender].at(at_s)
            where = where or told[one.way.sender, what.station_id].at(at_s)
            if where is not None:
                there = self._stations[one.way.receiver].at(at_s) or by_station[one.way.receiver].at(at_s)
                rssi_dbm = one.received.rssi_dbm if one.received is not None else None
                is_lost = one.fate is Fate.LOST
                yield Spot(at_s, one.way, what.station_id, what.type, is_lost, rssi_dbm, where, there, place is None)


def _degrees(place: Position) -> tuple[float, float]:
    return place.latitude / 1e7, place.longitude / 1e7
