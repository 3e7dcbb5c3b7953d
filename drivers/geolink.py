"""GeoNetworking between an interface and its Ethernet frames: what udp and ethernet have in common."""

from collections.abc import Callable

from board.loop import Timer
from drivers.contract import NOW, Host, Sent, Shared
from drivers.message import Request
from drivers.reason import Reason
from drivers.wire import frame
from drivers.wire.geonet import Asked, GeoNetworking, Heard, Received

# itsGnMaxSduSize (EN 302 636-4-1 V1.4.1, Annex H) is 1398 octets, and BTP takes 4 of them.
MAX_PAYLOAD = 1394

# Fields of RxInfo that GeoNetworking fills.
GEONETWORKING_METADATA = frozenset(
    {"btp_port", "traffic_class", "hop_limit", "security", "position", "area", "source_mac", "transport", "implausible"}
)


class GeoLink:
    """Frames in, indications out; requests in, frames out; beacons when nothing else was sent; answers to requests
    for the own position.

    mac         the interface's own: 6 octets.
    beacon_s    seconds without a packet of ours until a beacon; 0 for none.
    transmit    is given the frames of beacons and answers; one that cannot be sent is lost, the next one comes.
    gn_version  of packets that leave; it is accepted as well.
    """

    def __init__(
        self,
        host: Host,
        shared: Shared,
        mac: bytes,
        beacon_s: float,
        transmit: Callable[[bytes], Sent | None],
        gn_version: int = 1,
    ) -> None:
        self._host = host
        self._witness = shared.witness
        self._mac = mac
        self._transmit = transmit
        self._core = GeoNetworking(
            mac,
            shared.gn_versions | {gn_version},
            shared.deliver_unverified,
            beacon_s,
            shared.station_type,
            shared.is_mobile,
            shared.is_mac_configured,
            gn_version,
            shared.own,
        )
        self._timer: Timer | None = None

    def receive(self, octets: bytes, received_ns: int) -> None:
        """A frame came in: its PDU is indicated, its beacon heard, its request answered, or its loss counted."""
        host = self._host
        ethernet = frame.unwrap(octets)
        if isinstance(ethernet, Reason):
            host.drop(ethernet, octets)
            return
        event = self._core.receive(ethernet.packet, ethernet.source, host.loop.clock(), host.ego())
        if (watch := self._witness.watch) is not None:
            watch.came(host.name, octets, received_ns, event.pdu if isinstance(event, Received) else b"")
        if isinstance(event, Received):
            host.indicate(event.pdu, received_ns, event.rx)
        elif isinstance(event, Heard):
            host.heard(event.mac, None)
        elif isinstance(event, Asked):
            self._answer(event, octets)
        else:
            host.drop(event.reason, octets, detail=event.detail)

    def encode(self, request: Request) -> bytes:
        """The frame of a request: a single hop broadcast, or a GeoBroadcast when it has an area."""
        octets = frame.wrap(self._mac, self._core.encode(request, self._host.loop.clock(), self._host.ego()))
        if (watch := self._witness.watch) is not None:
            watch.made(self._host.name, octets, request)
        return octets

    def start(self) -> None:
        """Send beacons from now on."""
        deadline = self._core.deadline()
        if deadline is not None:
            loop = self._host.loop
            self._timer = loop.after(max(0.0, deadline - loop.clock()), self._expire)

    def stop(self) -> None:
        """Send no more beacons; idempotent."""
        if self._timer is not None:
            self._timer.cancel()

    def _answer(self, asked: Asked, octets: bytes) -> None:
        host = self._host
        host.heard(asked.mac, None)
        packet = self._core.answer(asked.position, host.loop.clock(), host.ego())
        if packet:
            self._send(frame.wrap(self._mac, packet, asked.mac))
        else:
            host.drop(Reason.GN_REQUESTS, octets)

    def _send(self, octets: bytes) -> None:
        """Transmit a frame that no user has requested."""
        if self._transmit(octets) is NOW and (watch := self._witness.watch) is not None:
            watch.made(self._host.name, octets, None)

    def _expire(self) -> None:
        # Every packet sent moves the deadline: the timer then comes early, takes nothing and is set again.
        self._core.expire(self._host.loop.clock())
        packet = self._core.take(self._host.ego())
        self.start()
        if packet:
            self._send(frame.wrap(self._mac, packet))
