"""GeoNetworking sender: broadcasts, beacons, Location Service replies. EN 302 636-4-1 V1.4.1 (2020-01)."""

import struct
from random import Random
from struct import Struct

from board.runtime.errors import RequestError
from board.time.scales import gn_timestamp
from drivers.message import Area, Ego, Request, Shape
from drivers.wire import btp
from drivers.wire.geonet.header import BasicNext, CommonNext, HeaderType, lifetime_octet
from drivers.wire.geonet.own import OwnPackets

# Values of clause 9 and defaults of Annex H.
_LIFETIME = 6 << 2 | 2  # itsGnDefaultPacketLifetime, 60 s, coded as other stations do: 6 x 10 s
_HOP_LIMIT = 10  # itsGnDefaultHopLimit
_MOBILE = 0x80  # bit of the flags: itsGnIsMobile
_MANUAL = 0x8000  # M bit of GN_ADDR, clause 6.3
_JITTER = 0.25  # itsGnBeaconServiceMaxJitter divided by itsGnBeaconServiceRetransmitTimer

# Location Service replies per second. A station asks seldom, and then once a second
# (itsGnLocationServiceRetransmitTimer). The limit keeps a flood of requests from occupying the channel.
ANSWERS_PER_S = 10

# Fields after _head(): traffic class, flags, payload length, maximum hop limit; extended header; BTP-B's port and an
# empty port info.
_POSITION = "8sIiiHH"
_SINGLE_HOP_OUT = Struct(">6sBBHBx" + _POSITION + "4xH2x")
_BEACON_OUT = Struct(">6sBBHBx" + _POSITION)
_REPLY_OUT = Struct(">6sBBHBxH2x" + _POSITION + "20s")
_GEO_BROADCAST_OUT = Struct(">BxBBBBBBHBxH2x" + _POSITION + "iiHHH2xH2x")


class Sender:
    """GeoNetworking sender of one station. Times are in seconds of the loop's clock.

    mac                own address; the last part of the GN address.
    beacon_s           silence after which a beacon is due: itsGnBeaconServiceRetransmitTimer; 0: no beacons.
    station_type       of the GN address (TS 102 894-2, StationType): 0 unknown, 5 passenger car; 0..31.
    is_mobile          itsGnIsMobile: the station may move.
    is_mac_configured  mac was configured manually.
    gn_version         protocol version: 1; 0 as in EN 302 636-4-1 V1.2.1, with the same headers.
    own                set that remembers each sent packet; None: the sender creates one.
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
        # Heads by lifetime: one for each lifetime in the table of message types.
        self._single_hops: dict[float, bytes] = {}
        self._beacon = self._head(_LIFETIME, 1, CommonNext.ANY, HeaderType.BEACON)
        self._reply = self._head(_LIFETIME, _HOP_LIMIT, CommonNext.ANY, HeaderType.LS_REPLY)
        self._answers = float(ANSWERS_PER_S)  # replies that may be sent now
        self._answered_at = 0.0
        self._address = struct.pack(">H6s", _MANUAL * is_mac_configured | station_type << 10, mac)
        self._flags = _MOBILE * is_mobile
        self._sequence = 0  # sequence number of the next multi-hop packet
        self._beacon_s = beacon_s
        self._random = Random(mac)  # seeded by the MAC, so that stations that start together do not send together
        self._silence_s = self._next_silence()
        self._sent_at: float | None = None
        self._is_due = False

    def encode(self, request: Request, now: float, ego: Ego) -> bytes:
        """Return the packet for a request: a GeoBroadcast if the request has an area, a single hop broadcast otherwise.

        A GeoBroadcast has the remaining lifetime and the hop limit of the request. A single hop broadcast has the
        lifetime of its message type. Raises RequestError if a number is out of range for its field.
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
        """Return the time when expire() must be called; None without beacons. Each sent packet postpones it."""
        if self._beacon_s <= 0:
            return None
        return 0.0 if self._sent_at is None else self._sent_at + self._silence_s

    def expire(self, now: float) -> bool:
        """Return True if a beacon is due, which take() then returns (clause 10.3.6).

        The first call only starts the timer.
        """
        deadline = self.deadline()
        if deadline is None or now < deadline:
            return False
        self._is_due = self._sent_at is not None
        self._sent_at = now
        self._silence_s = self._next_silence()
        return self._is_due

    def take(self, ego: Ego) -> bytes:
        """Return the beacon that is due, or no octets."""
        if not self._is_due:
            return b""
        self._is_due = False
        beacon = _BEACON_OUT.pack(self._beacon, 0, self._flags, 0, 1, *self._position(ego))
        self._own.note(beacon)
        return beacon

    def answer(self, position: bytes, now: float, ego: Ego) -> bytes:
        """Return the Location Service reply to a station (clause 10.3.7.3); no octets above ANSWERS_PER_S.

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
        """Return the basic header, then NH, HT and HST of the common header."""
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
        # Clause 9.8.5.2: for a circle, distance a is the radius; the other fields are 0.
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
        """Return the fields of the own long position vector. An unknown position is marked as inaccurate."""
        (latitude, longitude), speed = ego.position, ego.speed
        if not -0x4000 <= speed <= 0x3FFF:  # the field has 15 bits: up to 164 m/s
            speed = max(-0x4000, min(0x3FFF, speed))
        bits = (ego.is_known and ego.is_accurate) << 15 | speed & 0x7FFF
        return self._address, gn_timestamp(ego.its_ms), latitude, longitude, bits, ego.heading % 3600

    def _next_silence(self) -> float:
        return self._beacon_s * (1 + _JITTER * self._random.random())
