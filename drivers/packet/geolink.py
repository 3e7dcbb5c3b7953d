"""GeoNetworking between PDUs and Ethernet frames, shared by the drivers udp and ethernet."""

from collections.abc import Callable

from board.runtime.loop import Timer
from drivers.contract import NOW, Host, Sent, Shared
from drivers.message import Request
from drivers.reason import Reason
from drivers.wire import frame
from drivers.wire.geonet.protocol import Asked, GeoNetworking, Heard, Mib, Received

# itsGnMaxSduSize (EN 302 636-4-1 V1.4.1, Annex H) is 1398 octets, and BTP takes 4 of them.
MAX_PAYLOAD = 1394

# Fields of RxInfo that GeoNetworking fills.
GEONETWORKING_METADATA = frozenset(
    {"btp_port", "traffic_class", "hop_limit", "security", "position", "area", "source_mac", "transport", "implausible"}
)


class GeoLink:
    """Converts frames to indications and requests to frames. Also sends beacons and answers to location requests.

    mac         MAC address of the interface: 6 octets.
    beacon_s    seconds without a sent packet after which a beacon is sent; 0: no beacons.
    transmit    function that sends the frame of a beacon or answer. A frame that it cannot send is lost, without retry.
    gn_version  GeoNetworking protocol version of sent packets; it is also accepted at reception.
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
        mib = Mib(
            shared.gn_versions | {gn_version},
            shared.deliver_unverified,
            beacon_s,
            shared.station_type,
            shared.is_mobile,
            shared.is_mac_configured,
            gn_version,
        )
        self._core = GeoNetworking(mac, mib, shared.own)
        self._timer: Timer | None = None

    def receive(self, octets: bytes, received_ns: int) -> None:
        """Handle a received frame: indicate its PDU, report its beacon, answer its location request, or drop it.

        received_ns  time of reception: Unix time in nanoseconds.
        """
        host = self._host
        ethernet = frame.unwrap(octets)
        if isinstance(ethernet, Reason):
            host.drop(ethernet, octets)
            return
        event = self._core.receive(ethernet.packet, ethernet.source, host.loop.clock(), host.its_ms(), host.ego)
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
        """Return the frame of a request: a GeoBroadcast if it has an area, otherwise a single-hop broadcast."""
        octets = frame.wrap(self._mac, self._core.encode(request, self._host.loop.clock(), self._host.ego()))
        if (watch := self._witness.watch) is not None:
            watch.made(self._host.name, octets, request)
        return octets

    def start(self) -> None:
        """Start the timer of beacons."""
        deadline = self._core.deadline()
        if deadline is not None:
            loop = self._host.loop
            self._timer = loop.after(max(0.0, deadline - loop.clock()), self._expire)

    def stop(self) -> None:
        """Stop the timer of beacons; idempotent."""
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
        """Send a frame that is not a user's request: a beacon or an answer."""
        if self._transmit(octets) is NOW and (watch := self._witness.watch) is not None:
            watch.made(self._host.name, octets, None)

    def _expire(self) -> None:
        # Each sent packet postpones the next beacon but does not move the timer. It then fires too early, sends
        # nothing and is set again.
        is_due = self._core.expire(self._host.loop.clock())
        self.start()
        if is_due:
            self._send(frame.wrap(self._mac, self._core.take(self._host.ego())))
