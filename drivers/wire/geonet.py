"""GeoNetworking of one interface: packets in, packets out, beacons. EN 302 636-4-1 V1.4.1 (2020-01) with BTP."""

from collections.abc import Set

from drivers.wire.geonet_own import OwnPackets
from drivers.wire.geonet_receiver import Asked, Discard, Heard, Received, Receiver
from drivers.wire.geonet_sender import Sender

__all__ = ["Asked", "Discard", "GeoNetworking", "Heard", "Received"]


class GeoNetworking:
    """Both directions; the parameters and methods are those of Receiver and Sender.

    receive(packet, source_mac, now, ego) -> Received | Heard | Asked | Discard
    encode(request, now, ego) -> packet
    answer(position, now, ego) -> the answer to Asked, or nothing
    deadline() -> when expire() wants to be called; expire(now) -> whether a beacon is due; take(ego) -> that beacon
    """

    def __init__(
        self,
        mac: bytes,
        gn_versions: Set[int] = frozenset({1}),
        deliver_unverified: bool = True,
        beacon_s: float = 3.0,
        station_type: int = 0,
        is_mobile: bool = True,
        is_mac_configured: bool = False,
        gn_version: int = 1,
        own: OwnPackets | None = None,
    ) -> None:
        own = own or OwnPackets()
        receiver = Receiver(mac, gn_versions, deliver_unverified, own)
        sender = Sender(mac, beacon_s, station_type, is_mobile, is_mac_configured, gn_version, own)
        self.receive = receiver.receive
        self.encode = sender.encode
        self.answer = sender.answer
        self.deadline = sender.deadline
        self.expire = sender.expire
        self.take = sender.take
