"""Duplicate packet detection by source and sequence number: EN 302 636-4-1 V1.4.1 Annex A.2."""

from collections import deque

# Length of the list of a source: itsGnDPLLength, Annex H.
LIST = 8

# Seconds after its last packet that a source is forgotten: itsGnLifetimeLocTE, Annex H. A station that starts
# again counts from zero again.
LIFETIME = 20.0

# Sources remembered. ITS-G5 reaches a few hundred stations; forged addresses must not fill the memory.
SOURCES = 1024


class Duplicates:
    """The last sequence numbers of each source; of too many, the one silent for longest is forgotten."""

    def __init__(self) -> None:
        self._sources: dict[bytes, tuple[float, deque[int]]] = {}

    def __len__(self) -> int:
        return len(self._sources)

    def seen(self, source: bytes, sequence: int, now: float) -> bool:
        """Whether a packet was here before; from now on it was.

        source is the MAC in the GN address of who made the packet, not of who passed it on.
        """
        expires, numbers = self._sources.pop(source, (now, None))
        if numbers is None or expires <= now:
            numbers = deque(maxlen=LIST)
            if len(self._sources) >= SOURCES:
                del self._sources[next(iter(self._sources))]
        self._sources[source] = (now + LIFETIME, numbers)
        if sequence in numbers:
            return True
        numbers.append(sequence)
        return False
