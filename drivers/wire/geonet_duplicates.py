"""Duplicate packet detection by source and sequence number: EN 302 636-4-1 V1.4.1 Annex A.2."""

from enum import Enum, auto

# Length of the list of a source: itsGnDPLLength, Annex H.
LIST = 8

# Seconds after its last packet that a source is forgotten: itsGnLifetimeLocTE, Annex H. A station that starts
# again counts from zero again.
LIFETIME = 20.0

# Sources remembered. ITS-G5 reaches a few hundred stations; forged addresses must not fill the memory.
SOURCES = 1024

# Different packets remembered of one sequence number: an honest station has one.
PACKETS = 8


class Seen(Enum):
    """State of a packet: number is new, packet is known, or number is known with another payload."""

    NEW = auto()
    AGAIN = auto()
    OTHER = auto()


class Duplicates:
    """The last sequence numbers of each source; of too many, the one silent for longest is forgotten.

    Annex A.2 looks at source and number alone. Then one who sends the next numbers of another station, in its name,
    silences it. So the payload is compared as well: who passes a packet on does not change that.
    """

    def __init__(self) -> None:
        self._sources: dict[bytes, tuple[float, dict[int, tuple[int, ...]]]] = {}

    def __len__(self) -> int:
        return len(self._sources)

    def seen(self, source: bytes, sequence: int, payload: int, now: float) -> Seen:
        """Whether a packet was here before; from now on it was.

        source   the MAC in the GN address of who made the packet, not of who passed it on.
        payload  hash() of it.
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
