"""Packets that the station has sent: tells its own echo from another station with its address."""

# Packets remembered at least: 10 s of a station that sends 100 a second. An echo takes milliseconds, a GeoBroadcast
# that others pass on a few seconds.
KEPT = 1024
_BASIC_SIZE = 4  # the basic header is left out: who passes a packet on changes its remaining hop limit


class OwnPackets:
    """Two generations of KEPT packets, of which hash() of 64 bits is kept: 0.2 us a packet.

    All interfaces of a station share one: what one has sent, another may hear.

    macs  addresses of these interfaces.
    """

    def __init__(self) -> None:
        self.macs: set[bytes] = set()
        self._young: set[int] = set()
        self._old: set[int] = set()

    def note(self, packet: bytes) -> None:
        """A packet leaves, from its basic header on."""
        young = self._young
        young.add(hash(packet[_BASIC_SIZE:]))
        if len(young) >= KEPT:
            self._old, self._young = young, set()

    def has(self, behind: bytes) -> bool:
        """Return whether the station has sent a packet. behind: its octets after the basic header, without padding."""
        known = hash(behind)
        return known in self._young or known in self._old
