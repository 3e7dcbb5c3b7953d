"""Paths: counts which interface delivers a station's messages first, or alone.

The counters are kept per station and type. For example, the radio receives a near car first; only the broker delivers
a distant one.
"""

from collections import OrderedDict, defaultdict
from collections.abc import Iterable, Iterator
from itertools import islice

from firmware.topics import Topics

# Number of pairs of station and type that are kept, at 0.8 kB each. 300 stations with three types each fill a channel.
CAPACITY = 1024
SHOWN = 32  # number of paths in a status; it is limited because the status is sent once a second

Who = bytes  # octets 1 to 5 of a PDU: messageID and stationID (TS 102 894-2, ItsPduHeader)
WHO = 5
Lone = tuple[float, int, str, Who]  # time of reception, hash of the PDU, interface, sender and type


class Path:
    """Counters of one station's messages of one type, by interface.

    alone   number of messages that only this interface received; counted when their window ends.
    first   number of messages that this interface received before another one, and the sum of its leads in seconds.
    """

    __slots__ = ("alone", "first")

    def __init__(self) -> None:
        self.alone: defaultdict[str, int] = defaultdict(int)
        self.first: dict[str, tuple[int, float]] = {}


class Paths:
    """Paths of recently heard stations and types. Above `capacity`, the one without news for longest is removed.

    forgotten  number of removed paths.
    """

    def __init__(self, topics: Topics, capacity: int = CAPACITY) -> None:
        self.forgotten = 0
        self._topics = topics
        self._capacity = capacity
        self._paths: OrderedDict[Who, Path] = OrderedDict()

    def alone(self, gone: Iterable[Lone]) -> None:
        """Count PDUs that no second interface received inside the window.

        This is the usual case, so for speed it is called with many PDUs at once.
        """
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
        """Count a PDU that interface `first` received lead_s seconds before another interface."""
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
        """Return the most recent paths.

        paths            the 32 most recent paths: a row for each station and type. Empty with one receiving interface.
        paths_kept       number of paths that are kept, at most 1024.
        paths_forgotten  number of paths that were removed to make room for others.
        """
        recent = sorted(islice(reversed(self._paths.items()), SHOWN), key=lambda item: (item[0][1:], item[0][:1]))
        return {
            "paths": list(self._rows(recent)),
            "paths_kept": len(self._paths),
            "paths_forgotten": self.forgotten,
        }

    def _rows(self, paths: Iterable[tuple[Who, Path]]) -> Iterator[dict[str, object]]:
        """Yield a row for each station and type.

        station  stationID; null for a PDU without one.
        type     message type; empty for a PDU without one.
        first    number of messages that each interface received before another one, by name.
        lead_ms  average lead of each interface in ms over these messages, by name.
        alone    number of messages that only this interface received within the window, by name.
        """
        for who, path in paths:
            is_header = len(who) == WHO  # a PDU of an unknown BTP port may be shorter than a header
            yield {
                "station": int.from_bytes(who[1:]) if is_header else None,
                "type": self._topics.by_number[who[0]].name if is_header else "",
                "first": {name: count for name, (count, _) in path.first.items()},
                "lead_ms": {name: round(1000 * sum_s / count, 3) for name, (count, sum_s) in path.first.items()},
                "alone": dict(path.alone),
            }
