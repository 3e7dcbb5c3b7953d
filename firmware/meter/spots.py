"""Where messages were sent from, and what became of them there: a map."""

from bisect import bisect_left
from collections import OrderedDict, defaultdict
from collections.abc import Iterator
from typing import NamedTuple

from drivers.message import Position
from firmware.meter.matching import Fate, Settled, Way

MOST = 20_000
MOST_PLACES = 65_536  # of messages whose fate is not known yet


class Spot(NamedTuple):
    """A message: latitude and longitude of its sender in degrees; is_guessed: between where it was before and after."""

    at_s: float
    way: Way
    station_id: int | None
    type: str
    is_lost: bool
    rssi_dbm: int | None
    latitude: float
    longitude: float
    is_guessed: bool


class _Kept(NamedTuple):
    at_s: float
    one: Settled
    place: Position | None


class Spots:
    """Takes places as they become known, and fates; the first MOST of them, and `more` counts the rest."""

    def __init__(self) -> None:
        self.more = 0
        self._places: OrderedDict[str, Position] = OrderedDict()
        self._kept: list[_Kept] = []

    def place(self, digest: str, place: Position) -> None:
        self._places[digest] = place
        if len(self._places) > MOST_PLACES:
            self._places.popitem(last=False)

    def add(self, one: Settled) -> None:
        if one.sent is None or one.fate not in (Fate.ARRIVED, Fate.LOST):
            return
        if len(self._kept) >= MOST:
            self.more += 1
            return
        self._kept.append(_Kept(one.sent.at_s, one, self._places.get(one.sent.what.digest)))

    def __iter__(self) -> Iterator[Spot]:
        """Those whose sender's place is known, or can be had from the messages before and after."""
        by_sender: defaultdict[int | None, list[_Kept]] = defaultdict(list)
        for kept in self._kept:
            assert kept.one.sent is not None
            by_sender[kept.one.sent.what.station_id].append(kept)
        for several in by_sender.values():
            several.sort(key=lambda kept: kept.at_s)
            known = [kept for kept in several if kept.place is not None]
            moments = [kept.at_s for kept in known]
            for kept in several:
                where = _degrees(kept.place) if kept.place else _between(kept.at_s, known, moments)
                if where is not None:
                    yield _spot(kept, where)


def _spot(kept: _Kept, where: tuple[float, float]) -> Spot:
    one = kept.one
    assert one.sent is not None
    rssi_dbm = one.received.rssi_dbm if one.received is not None else None
    what = one.sent.what
    return Spot(
        kept.at_s, one.way, what.station_id, what.type, one.fate is Fate.LOST, rssi_dbm, *where, kept.place is None
    )


def _degrees(place: Position) -> tuple[float, float]:
    return place.latitude / 1e7, place.longitude / 1e7


def _between(at_s: float, known: list[_Kept], moments: list[float]) -> tuple[float, float] | None:
    """On the straight line between the places before and after; None where one of them is not known."""
    after = bisect_left(moments, at_s)
    if not 0 < after < len(known):
        return None
    one, other = known[after - 1], known[after]
    assert one.place is not None
    assert other.place is not None
    share = (at_s - one.at_s) / (other.at_s - one.at_s) if other.at_s > one.at_s else 0.0
    (a, b), (c, d) = _degrees(one.place), _degrees(other.place)
    return a + share * (c - a), b + share * (d - b)
