"""Stations heard on one interface: who, when last, how strongly."""

from collections import OrderedDict
from collections.abc import Iterator
from itertools import islice, takewhile

# More than a channel holds: 1,700 frames/s of stations that each speak once in 2 s.
CAPACITY = 4096
RECENT_S = 5.0  # EN 302 637-2 lets a station be silent for 1 s; five of those

Moments = OrderedDict[bytes, float]  # of each neighbour's last sign of life, the longest silent first


class Neighbours:
    """The last sign of life of each neighbour, the longest silent forgotten first.

    The policy may count for every request. So neighbours are kept by strength as well: those that are too weak are
    passed over by the level, not one by one.
    """

    def __init__(self, capacity: int = CAPACITY) -> None:
        self._heard: Moments = OrderedDict()
        self._rssi_dbm: dict[bytes, int] = {}
        self._levels: dict[int, Moments] = {}
        self._capacity = capacity

    def heard(self, who: bytes, now: float, rssi_dbm: int | None) -> None:
        """who is a MAC address where the interface knows it, else the client of a broker, else a stationID."""
        heard = self._heard
        heard[who] = now
        heard.move_to_end(who)
        if self._rssi_dbm:
            self._leave_level(who)
        if rssi_dbm is not None:
            self._rssi_dbm[who] = rssi_dbm
            self._levels.setdefault(rssi_dbm, OrderedDict())[who] = now
        if len(heard) > self._capacity:
            silent, _ = heard.popitem(last=False)
            self._leave_level(silent)

    def count(self, now: float, within_s: float = RECENT_S, rssi_dbm: int | None = None, enough: int = CAPACITY) -> int:
        """Neighbours heard in the last within_s seconds, at rssi_dbm or better where that is asked.

        enough  at which counting may end.

        A signal strength that the interface does not know is not good enough.
        """
        since = now - within_s
        if rssi_dbm is None:
            return _count(self._heard, since, enough)
        number = 0
        for level, moments in self._levels.items():
            if number >= enough:
                break
            if level >= rssi_dbm:
                number += _count(moments, since, enough - number)
        return number

    def _leave_level(self, who: bytes) -> None:
        level = self._rssi_dbm.pop(who, None)
        if level is None:
            return
        moments = self._levels[level]
        del moments[who]
        if not moments:
            del self._levels[level]


def newest_first(moments: Moments) -> Iterator[float]:
    return reversed(moments.values())


def _count(moments: Moments, since: float, enough: int) -> int:
    return sum(1 for _ in islice(takewhile(lambda moment: moment >= since, newest_first(moments)), enough))
