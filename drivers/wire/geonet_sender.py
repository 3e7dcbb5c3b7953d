"""GeoNetworking out: broadcasts, beacons, Location Service replies. EN 302 636-4-1 V1.4.1 (2020-01)."""

import struct
from random import Random
from struct import Struct

from board.errors import RequestError
from board.time import gn_timestamp
from drivers.message import Area, Ego, Request, Shape
from drivers.wire import btp
from drivers.wire.geonet_header import BasicNext, CommonNext, HeaderType, lifetime_octet
from drivers.wire.geonet_own import OwnPackets

# Clause 9 and the defaults of Annex H.
_LIFETIME = 6 << 2 | 2  # itsGnDefaultPacketLifetime, 60 s, as other stations code it: 6 x 10 s
_HOP_LIMIT = 10  # itsGnDefaultHopLimit
_MOBILE = 0x80  # flags: itsGnIsMobile
_MANUAL = 0x8000  # M of GN_ADDR, clause 6.3
_JITTER = 0.25  # itsGnBeaconServiceMaxJitter over itsGnBeaconServiceRetransmitTimer

# Location Service replies in a second. A station asks once a second, itsGnLocationServiceRetransmitTimer, and seldom;
# a flood of requests must not take the channel.
ANSWERS_PER_S = 10

# The rest: traffic class, flags, payload length, maximum hop limit; headers; BTP-B's port and empty port info.
_POSITION = "8sIiiHH"
_SINGLE_HOP_OUT = Struct(">6sBBHBx" + _POSITION + "4xH2x")
_BEACON_OUT = Struct(">6sBBHBx" + _POSITION)
_REPLY_OUT = Struct(">6sBBHBxH2x" + _POSITION + "20s")
_GEO_BROADCAST_OUT = Struct(">BxBBBBBBHBxH2x" + _POSITION + "iiHHH2xH2x")


class Sender:
    """Packets of one station. Time goes in as the loop's clock in seconds.

    mac                own address; the end of the GN address.
    beacon_s           silence after which a beacon is due: itsGnBeaconServiceRetransmitTimer; 0: no beacons.
    station_type       of the GN address (TS 102 894-2, StationType): 0 unknown, 5 passenger car; 0..31.
    is_mobile          itsGnIsMobile: whether the station may move.
    is_mac_configured  whether mac was configured by hand.
    gn_version         protocol version: 1; 0 as in EN 302 636-4-1 V1.2.1, with the same headers.
    own                remembers each packet; None: the sender has its own.
    """

    def __init__(
        self,
        mac: bytes,
        beacon_s: float = 3.0,
        station_type: int = 0,
        is_mobile: bool = True,
        is_mac_configured: bool = False,
        gn_version: int = 1,
        own: OwnPackets | None = None,
    ) -> None:
        self._own = own or OwnPackets()
        self._first = gn_version << 4 | BasicNext.COMMON
        self._single_hops: dict[float, bytes] = {}  # by lifetime: one for each that the table of types has
        self._beacon = self._head(_LIFETIME, 1, CommonNext.ANY, HeaderType.BEACON)
        self._reply = self._head(_LIFETIME, _HOP_LIMIT, CommonNext.ANY, HeaderType.LS_REPLY)
        self._answers = float(ANSWERS_PER_S)  # that are left
        self._answered_at = 0.0
        self._address = struct.pack(">H6s", _MANUAL * is_mac_configured | station_type << 10, mac)
        self._flags = _MOBILE * is_mobile
        self._sequence = 0  # of the next packet that others may pass on
        self._beacon_s = beacon_s
        self._random = Random(mac)  # stations that start together must not send together
        self._silence_s = self._next_silence()
        self._sent_at: float | None = None
        self._is_due = False

    def encode(self, request: Request, now: float, ego: Ego) -> bytes:
        """A packet for a request: a GeoBroadcast where it has an area, a single hop broadcast otherwise.

        The lifetime of a GeoBroadcast is what is left of the request's, its hop limit is the request's. A single
        hop broadcast has the lifetime of its type. Raises RequestError when a number does not fit its header.
        """
        try:
            packet = self._packet(request, now, ego)
        except struct.error as error:
            hops = request.hop_limit
            raise RequestError(f"GeoNetworking: {error}; {request.area}, {hops} hops") from error
        self._sent_at = now
        self._own.note(packet)
        return packet

    def deadline(self) -> float | None:
        """When expire() wants to be called, None where there are no beacons. Each packet sent moves it away."""
        if self._beacon_s <= 0:
            return None
        return 0.0 if self._sent_at is None else self._sent_at + self._silence_s

    def expire(self, now: float) -> bool:
        """Whether a beacon is due, which take() gives (clause 10.3.6). The first call begins the silence."""
        deadline = self.deadline()
        if deadline is None or now < deadline:
            return False
        self._is_due = self._sent_at is not None
        self._sent_at = now
        self._silence_s = self._next_silence()
        return self._is_due

    def take(self, ego: Ego) -> bytes:
        """The beacon that is due, or nothing."""
        if not self._is_due:
            return b""
        self._is_due = False
        beacon = _BEACON_OUT.pack(self._beacon, 0, self._flags, 0, 1, *self._position(ego))
        self._own.note(beacon)
        return beacon

    def answer(self, position: bytes, now: float, ego: Ego) -> bytes:
        """The Location Service reply to a station (clause 10.3.7.3); empty above ANSWERS_PER_S.

        position  short position vector of that station, 20 octets.
        """
        self._answers += (now - self._answered_at) * ANSWERS_PER_S
        self._answers = min(self._answers, ANSWERS_PER_S)
        self._answered_at = now
        if self._answers < 1:
            return b""
        self._answers -= 1
        self._sent_at = now
        own = self._position(ego)
        packet = _REPLY_OUT.pack(self._reply, 0, self._flags, 0, _HOP_LIMIT, self._sequence, *own, position)
        self._sequence = (self._sequence + 1) & 0xFFFF
        self._own.note(packet)
        return packet

    def _head(self, lifetime: int, hop_limit: int, next_header: CommonNext, header_type: HeaderType) -> bytes:
        """The basic header, then NH, HT and HST of the common header."""
        return bytes((self._first, 0, lifetime, hop_limit, next_header << 4, header_type))

    def _single_hop(self, lifetime: float) -> bytes:
        head = self._head(lifetime_octet(lifetime), 1, CommonNext.BTP_B, HeaderType.SHB)
        self._single_hops[lifetime] = head
        return head

    def _packet(self, request: Request, now: float, ego: Ego) -> bytes:
        if request.area is not None:
            return self._geo_broadcast(request, request.area, now, ego)
        pdu, lifetime = request.pdu, request.kind.lifetime
        head = _SINGLE_HOP_OUT.pack(
            self._single_hops.get(lifetime) or self._single_hop(lifetime),
            request.traffic_class,
            self._flags,
            len(pdu) + btp.SIZE,
            1,
            *self._position(ego),
            request.btp_port,
        )
        return head + pdu

    def _geo_broadcast(self, request: Request, area: Area, now: float, ego: Ego) -> bytes:
        pdu = request.pdu
        # Clause 9.8.5.2: a circle's radius is distance a, and nothing else is filled in.
        distance_b, angle = (0, 0) if area.shape is Shape.CIRCLE else (area.distance_b, area.angle)
        head = _GEO_BROADCAST_OUT.pack(
            self._first,
            lifetime_octet(request.deadline - now),
            request.hop_limit,
            CommonNext.BTP_B << 4,
            HeaderType.GBC_CIRCLE + area.shape,
            request.traffic_class,
            self._flags,
            len(pdu) + btp.SIZE,
            request.hop_limit,
            self._sequence,
            *self._position(ego),
            *area.centre,
            area.distance_a,
            distance_b,
            angle,
            request.btp_port,
        )
        self._sequence = (self._sequence + 1) & 0xFFFF
        return head + pdu

    def _position(self, ego: Ego) -> tuple[bytes, int, int, int, int, int]:
        """The numbers of the own long position vector. A place that is not known is marked as inaccurate."""
        (latitude, longitude), speed = ego.position, ego.speed
        if not -0x4000 <= speed <= 0x3FFF:  # 15 bits: 164 m/s
            speed = max(-0x4000, min(0x3FFF, speed))
        bits = (ego.is_known and ego.is_accurate) << 15 | speed & 0x7FFF
        return self._address, gn_timestamp(ego.its_ms), latitude, longitude, bits, ego.heading % 3600

    def _next_silence(self) -> float:
        return self._beacon_s * (1 + _JITTER * self._random.random())
