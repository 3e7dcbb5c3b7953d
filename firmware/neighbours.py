"""Stations heard on one interface: who, when last, how strongly."""

from collections import OrderedDict

# More than a channel holds: 1,700 frames/s of stations that each speak once in 2 s.
CAPACITY = 4096
RECENT_S = 5.0  # EN 302 637-2 lets a station be silent for 1 s; five of those


class Neighbours:
    """The last sign of life of each neighbour, the longest silent forgotten first."""

    def __init__(self, capacity: int = CAPACITY) -> None:
        self._heard: OrderedDict[bytes, tuple[float, int | None]] = OrderedDict()
        self._capacity = capacity

    def heard(self, who: bytes, now: float, rssi_dbm: int | None) -> None:
        """who is a MAC address where the interface knows it, else a stationID."""
        heard = self._heard
        heard[who] = (now, rssi_dbm)
        heard.move_to_end(who)
        if len(heard) > self._capacity:
            heard.popitem(last=False)

    def count(self, now: float, within_s: float = RECENT_S, rssi_dbm: int | None = None, enough: int = CAPACITY) -> int:
        """Neighbours heard in the last within_s seconds, at rssi_dbm or better where that is asked.

        enough  at which counting may end.

        A signal strength that the interface does not know is not good enough.
        """
        number = 0
        for when, rssi in reversed(self._heard.values()):
            if when < now - within_s or number >= enough:
                break
            number += rssi_dbm is None or (rssi is not None and rssi >= rssi_dbm)
        return number
