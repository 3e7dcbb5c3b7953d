"""Duplicate packet detection by source and sequence number: EN 302 636-4-1 V1.4.1 Annex A.2."""

from enum import Enum, auto

# Sequence numbers remembered per source: itsGnDPLLength, Annex H.
LIST = 8

# Seconds after its last packet until a source is forgotten: itsGnLifetimeLocTE, Annex H. A station that restarts
# begins again with sequence number 0.
LIFETIME = 20.0

# Sources remembered. ITS-G5 reaches a few hundred stations; forged addresses must not fill the memory.
SOURCES = 1024

# Different packets remembered per sequence number; a correct station sends one.
PACKETS = 8


class Seen(Enum):
    """Result of duplicate detection: NEW for a new number, AGAIN for a known packet, OTHER for a new payload."""

    NEW = auto()
    AGAIN = auto()
    OTHER = auto()


class Duplicates:
    """Last sequence numbers of each source. If there are too many sources, the one silent for longest is dropped.

    Annex A.2 compares only source and number. An attacker could then silence a station by sending its next numbers in
    its name. Therefore the payload is compared too: a station that forwards a packet does not change its payload.
    """

    def __init__(self) -> None:
        self._sources: dict[bytes, tuple[float, dict[int, tuple[int, ...]]]] = {}

    def __len__(self) -> int:
        return len(self._sources)

    def seen(self, source: bytes, sequence: int, payload: int, now: float) -> Seen:
        """Return the state of a packet, and remember the packet.

        source   MAC in the GN address of the packet's source, not of a forwarder.
        payload  hash() of the payload.
        """
        expires, numbers = self._sources.pop(source, (now, None))
        if numbers is None or expires <= now:
            numbers = {}
            if len(self._sources) >= SOURCES:
                del self._sources[next(iter(self._sources))]
        self._sources[source] = (now + LIFETIME, numbers)
        known = numbers.get(sequence)
        if known is None:
            if len(numbers) >= LIST:
                del numbers[next(iter(numbers))]
            numbers[sequence] = (payload,)
            return Seen.NEW
        if payload in known:
            return Seen.AGAIN
        numbers[sequence] = (*known, payload)[-PACKETS:]
        return Seen.OTHER
