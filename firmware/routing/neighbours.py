"""Neighbours of one interface: last reception and signal strength of each station."""

from collections import OrderedDict
from collections.abc import Iterator
from itertools import islice, takewhile

# More stations than a channel can serve: 1,700 frames/s divided among stations that each send once in 2 s.
CAPACITY = 4096
RECENT_S = 5.0  # five times the longest pause between two CAMs of a station, which is 1 s by EN 302 637-2

Moments = OrderedDict[bytes, float]  # last reception of each neighbour, the oldest first


class Neighbours:
    """Last reception and signal strength of each neighbour.

    Above `capacity` neighbours, the one that has been silent for the longest time is forgotten. The policy may count
    neighbours for every request. They are therefore also grouped by signal strength, so that a group with a too weak
    signal is skipped as a whole.
    """

    def __init__(self, capacity: int = CAPACITY) -> None:
        self._heard: Moments = OrderedDict()
        self._rssi_dbm: dict[bytes, int] = {}
        self._levels: dict[int, Moments] = {}
        self._capacity = capacity

    def heard(self, who: bytes, now: float, rssi_dbm: int | None) -> None:
        """Record a reception.

        who       identity of the sender: its MAC address if known, else its name at a broker, else its stationID.
        now       time on the loop's clock.
        rssi_dbm  signal strength; None if unknown.
        """
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
        """Return the number of neighbours heard in the last within_s seconds.

        rssi_dbm  least signal strength. A neighbour of unknown signal strength then does not count. None: any.
        enough    number at which counting may stop: a larger result is not needed.
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
