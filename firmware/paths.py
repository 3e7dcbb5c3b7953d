"""Which interface brings the messages of a station first, by how much, and which ones it alone brings.

Kept for each station and type: a car that is near is heard by radio first, one that is far by a broker alone.
"""

from collections import OrderedDict, defaultdict
from collections.abc import Iterable, Iterator
from itertools import islice

from firmware.topics import Topics

# Stations and types: 300 stations with three types each, all that a channel carries. 0.8 kB each.
CAPACITY = 1024
SHOWN = 32  # of them in a status, which is sent once a second

Who = bytes  # octets 1 to 5 of a PDU: messageID and stationID (TS 102 894-2, ItsPduHeader)
WHO = 5
Lone = tuple[float, int, str, Who]  # when a PDU came, its hash, the interface, who sent what


class Path:
    """One station's messages of one type, by interface.

    alone   how many it alone has brought, as is known when the window has passed.
    first   how often it was the first, and the seconds that it led by, summed up.
    """

    __slots__ = ("alone", "first")

    def __init__(self) -> None:
        self.alone: defaultdict[str, int] = defaultdict(int)
        self.first: dict[str, tuple[int, float]] = {}


class Paths:
    """The paths of those stations and types that were heard of late; the least recent goes, and is counted."""

    def __init__(self, topics: Topics, capacity: int = CAPACITY) -> None:
        self.forgotten = 0
        self._topics = topics
        self._capacity = capacity
        self._paths: OrderedDict[Who, Path] = OrderedDict()

    def alone(self, gone: Iterable[Lone]) -> None:
        """PDUs that no second interface has shown inside the window. Called with many at once: it is the usual case."""
        paths = self._paths
        get, refresh = paths.get, paths.move_to_end
        for _, _, interface, who in gone:
            path = get(who)
            if path is None:
                path = self._new(who)
            else:
                refresh(who)
            path.alone[interface] += 1

    def pair(self, who: Who, first: str, lead_s: float) -> None:
        """A second interface has shown it, so much later than the first."""
        path = self._paths.get(who)
        if path is None:
            path = self._new(who)
        else:
            self._paths.move_to_end(who)
        count, sum_s = path.first.get(first, (0, 0.0))
        path.first[first] = count + 1, sum_s + lead_s

    def _new(self, who: Who) -> Path:
        if len(self._paths) >= self._capacity:
            self._paths.popitem(last=False)
            self.forgotten += 1
        path = self._paths[who] = Path()
        return path

    def status(self) -> dict[str, object]:
        """The most recent ones, by station and type."""
        recent = sorted(islice(reversed(self._paths.items()), SHOWN), key=lambda item: (item[0][1:], item[0][:1]))
        return {
            "paths": list(self._rows(recent)),
            "paths_kept": len(self._paths),
            "paths_forgotten": self.forgotten,
        }

    def _rows(self, paths: Iterable[tuple[Who, Path]]) -> Iterator[dict[str, object]]:
        for who, path in paths:
            is_header = len(who) == WHO  # of a port that no table has a PDU may be shorter
            yield {
                "station": int.from_bytes(who[1:]) if is_header else None,
                "type": self._topics.by_number[who[0]].name if is_header else "",
                "first": {name: count for name, (count, _) in path.first.items()},
                "lead_ms": {name: round(1000 * sum_s / count, 3) for name, (count, sum_s) in path.first.items()},
                "alone": dict(path.alone),
            }
