"""GeoNetworking of one interface, with BTP: receiver, sender, beacons. EN 302 636-4-1 V1.4.1 (2020-01)."""

from collections.abc import Set
from typing import NamedTuple

from drivers.wire.geonet.own import OwnPackets
from drivers.wire.geonet.receiver import Asked, Discard, Heard, PacketReceiver, Received
from drivers.wire.geonet.sender import Sender

__all__ = ["Asked", "Discard", "GeoNetworking", "Heard", "Mib", "Received"]


class Mib(NamedTuple):
    """Management information base: settings of one interface. EN 302 636-4-1 V1.4.1, Annex H.

    gn_versions        accepted protocol versions (itsGnProtocolVersion).
    gn_version         protocol version of sent packets.
    deliver_unverified  itsGnSnDecapResultHandling NON-STRICT: a signed packet's PDU is passed on unverified.
    beacon_s           itsGnBeaconServiceRetransmitTimer in seconds; 0 for no beacons.
    station_type       station type in the GN address.
    is_mobile          itsGnIsMobile.
    is_mac_configured  M bit of the GN address (clause 6.3).
    """

    gn_versions: Set[int] = frozenset({1})
    deliver_unverified: bool = True
    beacon_s: float = 3.0
    station_type: int = 0
    is_mobile: bool = True
    is_mac_configured: bool = False
    gn_version: int = 1


class GeoNetworking:
    """GeoNetworking in both directions; PacketReceiver and Sender describe parameters and methods.

    receive(packet, source_mac, now, its_ms, ego) -> Received | Heard | Asked | Discard
    encode(request, now, ego) -> packet
    answer(position, now, ego) -> Location Service reply to Asked, or nothing
    deadline() -> time when expire() must be called
    expire(now) -> True if a beacon is due
    take(ego) -> that beacon
    """

    def __init__(self, mac: bytes, mib: Mib = Mib(), own: OwnPackets | None = None) -> None:  # noqa: B008 it is immutable
        own = own or OwnPackets()
        receiver = PacketReceiver(mac, mib.gn_versions, mib.deliver_unverified, own)
        sender = Sender(mac, mib.beacon_s, mib.station_type, mib.is_mobile, mib.is_mac_configured, mib.gn_version, own)
        self.receive = receiver.receive
        self.encode = sender.encode
        self.answer = sender.answer
        self.deadline = sender.deadline
        self.expire = sender.expire
        self.take = sender.take
