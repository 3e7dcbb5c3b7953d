"""Kept files of a ring: divides the room among causes, and a cause's room among stations."""

import os
import re
from collections import Counter, defaultdict, deque
from heapq import heapify, heappop, heapreplace
from pathlib import Path
from typing import NamedTuple

KEPT = re.compile(r"kept-(\d{8})-[0-9TZ]+-(.*)\.pcapng")
OWN = "own"  # replaces the stationID for a message of this station
# A station that forges DENMs may use any stationID. Therefore this station's messages and each other cause have shares
# that received DENMs cannot use.
_KEY = re.compile(rf"(denm|loss|gnss)(?:-([0-9]+|{OWN}))?")
_OPERATOR = "operator"
OF_EVENT = 2  # an event may replace older kept files in at most half of their room
_LONGEST = 40  # characters of a reason in a file name


class Key(NamedTuple):
    """Share in which a kept file is counted: its cause and, for a DENM, its station."""

    cause: str
    station: str = ""


def word_of(why: str) -> str:
    """Return a reason in the form used in file names."""
    return re.sub(r"[^A-Za-z0-9]+", "-", why).strip("-")[:_LONGEST] or "event"


def operators(why: str) -> str:
    """Return an operator's reason, with a prefix if it could be mistaken for another cause."""
    word = word_of(why)
    return f"{_OPERATOR}-{word}"[:_LONGEST] if _KEY.fullmatch(word) else why


def key_of(word: str) -> Key:
    found = _KEY.fullmatch(word)
    if found is None:
        return Key(_OPERATOR)
    cause, station = found[1], found[2] or ""
    return Key(OWN) if station == OWN else Key(cause, station)


class Kept(NamedTuple):
    """Kept file.

    number  number in its name; the oldest file has the lowest.
    path    its path.
    size    its size in octets.
    key     share in which it is counted.
    """

    number: int
    path: Path
    size: int
    key: Key


class Shares:
    """Kept files of a folder, limited in total size. Beyond the limit, the oldest file of the largest share is removed.

    Files of the current event are never removed. They count in a share only from the next event on.

    size     octets of all kept files.
    removed  number of removed files.
    """

    def __init__(self, size: int) -> None:
        self.size = self.removed = 0
        self._limit = size
        self._known: dict[str, Kept] = {}  # by file name
        self._of_event: list[Kept] = []
        self._causes: Counter[str] = Counter()  # octets by cause
        self._keys: Counter[Key] = Counter()
        self._files: dict[Key, deque[Kept]] = defaultdict(deque)  # by share, the oldest file first
        # By cause: heap of (-octets, number of the oldest file, share), so that the largest share comes first.
        self._largest: dict[str, list[tuple[int, int, Key]]] = {}

    def look(self, folder: Path) -> None:
        """Begin an event, and read the folder: earlier runs left files there, and an operator may have removed some.

        Each file is examined once: 20,000 files take 0.3 s, later only their names are listed in 25 ms. Raises OSError.
        """
        ended, self._of_event = sorted(self._of_event), []
        self._largest = {}
        for one in ended:
            self._count(one)
        names = {name: match for name in os.listdir(folder) if (match := KEPT.fullmatch(name))}
        if names.keys() != self._known.keys():
            self._known = {name: self._known.get(name) or _found(folder / name, match) for name, match in names.items()}
            self.size = sum(one.size for one in self._known.values())
            for counts in (self._causes, self._keys, self._files):
                counts.clear()
            for one in sorted(self._known.values()):
                self._count(one)

    def taken(self, key: Key) -> int:
        """Return the octets of a share, including files of the current event."""
        return self._keys[key] + sum(one.size for one in self._of_event if one.key == key)

    def is_room(self, size: int, key: Key) -> bool:
        """Make room for a file by removing the oldest files of larger shares; return whether it fits."""
        while self.size + size > self._limit:
            victim = self._victim(size, key)
            if victim is None:
                return False
            try:
                victim.path.unlink(missing_ok=True)
            except OSError:
                return False
            self._forget(victim)
            self.removed += 1
        return True

    def keep(self, path: Path, size: int, word: str) -> None:
        """Rename a file of the ring so that it is kept. Raises OSError."""
        place = path.stem.partition("-")[2]
        kept = path.with_name(f"kept-{place}-{word}.pcapng")
        path.rename(kept)
        one = Kept(int(place[:8]), kept, size, key_of(word))
        self._known[kept.name] = one
        self._of_event.append(one)
        self.size += size

    def _count(self, one: Kept) -> None:
        self._causes[one.key.cause] += one.size
        self._keys[one.key] += one.size
        self._files[one.key].append(one)

    def _victim(self, size: int, key: Key) -> Kept | None:
        """Return the file to remove: the oldest one of the largest share.

        Returns None if no share is larger than the requesting one, or if the event has used its part of the room.
        """
        if sum(one.size for one in self._of_event) + size > self._limit // OF_EVENT:
            return None
        cause = max(self._causes, key=lambda one: (self._causes[one], one), default=key.cause)
        if self._causes[cause] <= self._causes[key.cause]:
            cause = key.cause
        if cause not in self._largest:
            self._largest[cause] = [self._rank(one) for one in self._files if one.cause == cause]
            heapify(self._largest[cause])
        largest = self._largest[cause]
        return self._files[largest[0][2]][0] if largest else None

    def _forget(self, one: Kept) -> None:
        """Remove a file from the counts: it is the oldest of the largest share of its cause."""
        key, largest = one.key, self._largest[one.key.cause]
        self.size -= one.size
        self._causes[key.cause] -= one.size
        self._keys[key] -= one.size
        del self._known[one.path.name]
        self._files[key].popleft()
        if self._files[key]:
            heapreplace(largest, self._rank(key))
        else:
            heappop(largest)
            del self._files[key], self._keys[key]

    def _rank(self, key: Key) -> tuple[int, int, Key]:
        return -self._keys[key], self._files[key][0].number, key


def _found(path: Path, match: re.Match[str]) -> Kept:
    return Kept(int(match[1]), path, path.stat().st_size, key_of(match[2]))
