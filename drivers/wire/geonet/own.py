"""Packets sent by this station: distinguishes its own echo from a station with the same address."""

# Packets remembered at least: 10 s at 100 packets per second. An echo takes milliseconds, a GeoBroadcast that others
# forward a few seconds.
KEPT = 1024
_BASIC_SIZE = 4  # the basic header is left out, because each forwarder changes the remaining hop limit


class OwnPackets:
    """Set of the packets sent last, as 64-bit hash() in two generations of KEPT packets. It costs 0.2 us per packet.

    All interfaces of a station share one set, because one interface may hear what another has sent.

    macs  addresses of these interfaces.
    """

    def __init__(self) -> None:
        self.macs: set[bytes] = set()
        self._young: set[int] = set()
        self._old: set[int] = set()

    def note(self, packet: bytes) -> None:
        """Remember a sent packet, given from its basic header on."""
        young = self._young
        young.add(hash(packet[_BASIC_SIZE:]))
        if len(young) >= KEPT:
            self._old, self._young = young, set()

    def has(self, behind: bytes) -> bool:
        """Return True if the station has sent a packet.

        behind  octets of the packet after the basic header, without padding.
        """
        known = hash(behind)
        return known in self._young or known in self._old
