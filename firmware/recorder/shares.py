"""Kept files of a ring: their room is shared by causes, and the room of a cause by stations."""

import re
from collections import Counter
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

    removed  files, so far.
    """

    def __init__(self, size: int) -> None:
        self.removed = 0
        self._limit = size
        self._files: list[Kept] = []

    @property
    def size(self) -> int:
        return sum(one.size for one in self._files)

    def look(self, folder: Path) -> None:
        """Know what is there: earlier runs have left it, or an operator has removed it. Raises OSError."""
        found = [(path, match) for path in folder.iterdir() if (match := KEPT.fullmatch(path.name))]
        self._files = sorted(Kept(int(match[1]), path, path.stat().st_size, key_of(match[2])) for path, match in found)

    def taken(self, key: Key) -> int:
        """Octets that count for a key."""
        return sum(one.size for one in self._files if one.key == key)

    def is_room(self, size: int, key: Key, since: int) -> bool:
        """Whether a file of this size fits, once the oldest of larger shares are removed.

        since  number of the first file of this event, of which none is removed.
        """
        while self.size + size > self._limit:
            victim = self._victim(size, key, since)
            if victim is None:
                return False
            try:
                victim.path.unlink(missing_ok=True)
            except OSError:
                return False
            self._files.remove(victim)
            self.removed += 1
        return True

    def keep(self, path: Path, size: int, word: str) -> None:
        """Give a file of the ring the name by which it stays. Raises OSError."""
        place = path.stem.partition("-")[2]
        kept = path.with_name(f"kept-{place}-{word}.pcapng")
        path.rename(kept)
        self._files.append(Kept(int(place[:8]), kept, size, key_of(word)))
        self._files.sort()

    def _victim(self, size: int, key: Key, since: int) -> Kept | None:
        """The oldest file of the largest share, where that is no smaller than the share that asks had before."""
        earlier = [one for one in self._files if one.number < since]
        if self.size - sum(one.size for one in earlier) + size > self._limit // OF_EVENT:
            return None
        causes: Counter[str] = Counter()
        keys: Counter[Key] = Counter()
        for one in earlier:
            causes[one.key.cause] += one.size
            keys[one.key] += one.size

        def may_go(one: Kept) -> bool:
            if one.key.cause != key.cause:
                return causes[one.key.cause] > causes[key.cause]
            return keys[one.key] >= keys[key]

        files = [one for one in earlier if may_go(one)]
        return max(files, key=lambda one: (causes[one.key.cause], keys[one.key], -one.number), default=None)
