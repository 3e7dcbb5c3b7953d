"""Kept files of a ring: their room is shared by causes, and the room of a cause by stations."""

import os
import re
from collections import Counter, defaultdict, deque
from heapq import heapify, heappop, heapreplace
from pathlib import Path
from typing import NamedTuple

KEPT = re.compile(r"kept-(\d{8})-[0-9TZ]+-(.*)\.pcapng")
OWN = "own"  # in place of a station: a message that this station sent
# A station that makes DENMs up can call itself as it likes. So what this station sent, and each other cause, has a
# share that no DENM takes.
_KEY = re.compile(rf"(denm|loss|gnss)(?:-([0-9]+|{OWN}))?")
_OPERATOR = "operator"
OF_EVENT = 2  # an event takes half of the room from others at most
_LONGEST = 40  # characters of a reason in a name


class Key(NamedTuple):
    """Whose share a kept file counts in."""

    cause: str
    station: str = ""


def word_of(why: str) -> str:
    """A reason as a part of a file's name."""
    return re.sub(r"[^A-Za-z0-9]+", "-", why).strip("-")[:_LONGEST] or "event"


def operators(why: str) -> str:
    """An operator's reason, which does not pass for another cause."""
    word = word_of(why)
    return f"{_OPERATOR}-{word}"[:_LONGEST] if _KEY.fullmatch(word) else why


def key_of(word: str) -> Key:
    found = _KEY.fullmatch(word)
    if found is None:
        return Key(_OPERATOR)
    cause, station = found[1], found[2] or ""
    return Key(OWN) if station == OWN else Key(cause, station)


class Kept(NamedTuple):
    """A kept file; number as in its name, by which the oldest is known."""

    number: int
    path: Path
    size: int
    key: Key


class Shares:
    """The kept files of a folder, within a size. Where it is used up, the oldest of the largest share goes.

    Files of the present event are not removed, and count in no share before the next event.

    size     octets of all.
    removed  files, so far.
    """

    def __init__(self, size: int) -> None:
        self.size = self.removed = 0
        self._limit = size
        self._known: dict[str, Kept] = {}  # by name
        self._of_event: list[Kept] = []
        self._clear()

    def _clear(self) -> None:
        self._causes: Counter[str] = Counter()  # octets
        self._keys: Counter[Key] = Counter()
        self._files: dict[Key, deque[Kept]] = defaultdict(deque)  # the oldest first
        self._largest: dict[str, list[tuple[int, int, Key]]] = {}  # by cause: a heap of -octets, oldest file, key

    def look(self, folder: Path) -> None:
        """Begin an event, and know what is there: earlier runs have left it, or an operator has removed it.

        A file is looked at once: 20,000 of them take 0.3 s, and later only their names, 25 ms. Raises OSError.
        """
        ended, self._of_event = sorted(self._of_event), []
        self._largest = {}
        for one in ended:
            self._count(one)
        names = {name: match for name in os.listdir(folder) if (match := KEPT.fullmatch(name))}
        if names.keys() != self._known.keys():
            self._known = {name: self._known.get(name) or _found(folder / name, match) for name, match in names.items()}
            self.size = sum(one.size for one in self._known.values())
            self._clear()
            for one in sorted(self._known.values()):
                self._count(one)

    def taken(self, key: Key) -> int:
        """Octets that count for a key, with those of the event."""
        return self._keys[key] + sum(one.size for one in self._of_event if one.key == key)

    def is_room(self, size: int, key: Key) -> bool:
        """Whether a file of this size fits, once the oldest of larger shares are removed."""
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
        """Give a file of the ring the name by which it stays. Raises OSError."""
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
        """The oldest file of the largest share, where that is no smaller than the share that asks had before."""
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
        """Of the largest share of its cause, whose next file is then the oldest."""
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
