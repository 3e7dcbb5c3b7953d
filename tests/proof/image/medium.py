"""Simulated drive in a file, with a cache that a power cut empties.

An honest drive promises two things. A write before a flush is kept once the flush is answered. A write that was asked
to be durable is kept by itself. Of everything else each sector may be kept or not, in any order.
"""

import os
from enum import StrEnum
from pathlib import Path
from random import Random
from typing import NamedTuple

SECTOR = 512  # octets: what a drive writes whole or not at all
CACHE = 32 << 20  # octets: more than a card has, less than would hurt
CHUNK = 1 << 20  # octets of zeros that are written at once


class Fate(StrEnum):
    """What becomes of writes that nobody has waited for."""

    DROP = "loses"  # none is kept
    SHUFFLE = "reorders"  # some are, in any order
    TEAR = "tears"  # some sectors of some are
    KEEP = "keeps"  # all are: the machine has died, and the drive has not


class Pending(NamedTuple):
    """A write in the cache, by its number."""

    number: int
    offset: int
    octets: bytes

    @property
    def sectors(self) -> range:
        first = self.offset // SECTOR
        return range(first, first + len(self.octets) // SECTOR)


class Loss(NamedTuple):
    """What a cut has met: writes in the cache, and how many of them were kept whole, in part, and not at all."""

    pending: int
    whole: int
    torn: int
    gone: int


class Medium:
    """The sectors of a file. What read() gives is what was written last; what a cut leaves may be older.

    path   the card, which is changed.
    cache  octets that wait at most: a drive whose cache is full writes all of it down.
    """

    def __init__(self, path: Path, cache: int = CACHE) -> None:
        self._file = os.open(path, os.O_RDWR | os.O_CLOEXEC)
        self.size = os.fstat(self._file).st_size // SECTOR * SECTOR
        self._cache = cache
        self._numbers = 0
        self._pending: list[Pending] = []
        self._waiting = 0  # octets of them
        # Of each sector that a write waits for: what is kept as yet; and which write has made that durable since.
        self._kept: dict[int, bytes] = {}
        self._durable: dict[int, int] = {}

    def close(self) -> None:
        os.close(self._file)

    def grow(self, octets: int) -> None:
        """A larger card, as when an image is written to one: what is behind it is zeros. Without power only."""
        self.size += octets
        os.ftruncate(self._file, self.size)

    def read(self, offset: int, size: int) -> bytes:
        return os.pread(self._file, size, offset)

    def write(self, offset: int, octets: bytes, is_durable: bool = False) -> None:
        """Whole sectors. is_durable: kept once this returns (FUA)."""
        write = self._numbered(offset, octets)
        if is_durable:
            os.pwrite(self._file, octets, offset)
            for sector in write.sectors if self._kept else ():
                self._kept.pop(sector, None)
                self._durable[sector] = write.number
            return
        self._add(write)
        if self._waiting > self._cache:
            self.flush()

    def zero(self, offset: int, size: int, is_durable: bool = False) -> None:
        """Zeros, as a write of them."""
        for at in range(offset, offset + size, CHUNK):
            self.write(at, bytes(min(CHUNK, offset + size - at)), is_durable)

    def flush(self) -> None:
        """All that was written is kept from here on."""
        self._pending.clear()
        self._kept.clear()
        self._durable.clear()
        self._waiting = 0

    def cut(self, fate: Fate, random: Random, unanswered: tuple[int, bytes] | None = None) -> Loss:
        """Take away the power. unanswered: offset and octets of a write that was on its way, durable or not."""
        if unanswered is not None:
            self._add(self._numbered(*unanswered))
        pending, durable, kept = self._pending, self._durable, self._kept
        masks = [_kept_of(write, fate, random) for write in pending]
        if fate is not Fate.KEEP:
            for sector, octets in kept.items():
                os.pwrite(self._file, octets, sector * SECTOR)
            for index in random.sample(range(len(pending)), len(pending)):
                self._put(pending[index], masks[index], durable)
        self.flush()
        whole = sum(all(mask) for mask in masks)
        gone = sum(not any(mask) for mask in masks)
        return Loss(len(masks), whole, len(masks) - whole - gone, gone)

    def _numbered(self, offset: int, octets: bytes) -> Pending:
        self._numbers += 1
        return Pending(self._numbers, offset, octets)

    def _add(self, write: Pending) -> None:
        old = os.pread(self._file, len(write.octets), write.offset)
        for at, sector in enumerate(write.sectors):
            if sector not in self._kept:
                self._kept[sector] = old[at * SECTOR : (at + 1) * SECTOR]
        os.pwrite(self._file, write.octets, write.offset)
        self._pending.append(write)
        self._waiting += len(write.octets)

    def _put(self, write: Pending, mask: list[bool], durable: dict[int, int]) -> None:
        """The sectors of a write that are kept, but for those that a later durable write has."""
        for at, sector in enumerate(write.sectors):
            if mask[at] and durable.get(sector, 0) < write.number:
                os.pwrite(self._file, write.octets[at * SECTOR : (at + 1) * SECTOR], sector * SECTOR)


def _kept_of(write: Pending, fate: Fate, random: Random) -> list[bool]:
    """Of each sector of a write whether it is kept."""
    size = len(write.sectors)
    if fate is Fate.DROP:
        return [False] * size
    if fate is Fate.KEEP:
        return [True] * size
    if fate is Fate.SHUFFLE:
        return [random.random() < 0.5] * size
    match random.randrange(4):
        case 0:
            return [False] * size
        case 1:
            return [True] * size
        case 2:  # the power went in its middle
            first = random.randrange(size + 1)
            return [at < first for at in range(size)]
        case _:  # its sectors lie in several places
            return [random.random() < 0.5 for _ in range(size)]
