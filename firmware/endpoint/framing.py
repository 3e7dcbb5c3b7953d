"""Framing: constructs a frame for a message of an interface without frames.

All recordings thus have the same format. The PDU is unchanged. The headers around it are constructed from the
message's metadata: GeoNetworking by EN 302 636-4-1 V1.4.1 clause 9, BTP-B by EN 302 636-5-1.
"""

from itertools import count
from struct import Struct

from board.time.scales import gn_timestamp
from drivers.message import ITS_HEADER, NO_MAC, Area, Ego, Indication, Request, Shape
from drivers.wire import btp, frame
from drivers.wire.geonet.header import BasicNext, CommonNext, HeaderType

_FIRST = 1 << 4 | BasicNext.COMMON
_LIFETIME = 6 << 2 | 2  # 6 times 10 s: the default of 60 s, Annex H
_LOCAL = b"\x02\x00"  # first octets of the address for a sender of unknown MAC address; its stationID follows
_KNOWN = 0x8000  # position accuracy indicator (PAI): the position is known

# Layouts for struct: basic and common header; sender's position vector; extended header with BTP-B, for SHB and GBC.
_HEAD = Struct(">BxBBBBBBHBx")
_POSITION = "2x6sIiiHH"
_SINGLE_HOP = Struct(f">{_POSITION}4xH2x")
_GEO_BROADCAST = Struct(f">H2x{_POSITION}iiHHH2xH2x")

_sequence = count()


def of_indication(one: Indication, now_ns: int, ego: Ego) -> bytes:
    """Return a frame that could have carried a received message.

    now_ns  Unix time in ns at which ego was valid.
    ego     own position and ITS time, from which the time of reception is computed.

    Raises struct.error if a value is out of range for its field.
    """
    rx, pdu = one.rx, one.pdu
    port = one.kind.btp_port if rx.btp_port is None else rx.btp_port
    its_ms = ego.its_ms - (now_ns - one.received_ns) // 1_000_000
    mac = rx.source_mac if rx.source_mac != NO_MAC else _mac(pdu)
    hops = max(1, rx.hop_limit)
    return _frame(mac, its_ms, rx.position, any(rx.position), rx.traffic_class, hops, rx.area, port or 0, pdu)


def of_request(request: Request, mac: bytes, ego: Ego) -> bytes:
    """Return a frame that could have carried a request.

    mac  MAC address of the station.
    ego  own position and ITS time, for the sender's position vector.

    Raises struct.error if a value is out of range for its field.
    """
    hops, port, pdu = request.hop_limit, request.btp_port, request.pdu
    where, is_known = ego.position, ego.is_known
    return _frame(mac, ego.its_ms, where, is_known, request.traffic_class, hops, request.area, port, pdu)


def of_octets(octets: bytes) -> bytes:
    """Return a frame around octets that were dropped before they were identified as a PDU.

    Its BTP port is 0, so that no program decodes the octets.
    """
    return _frame(_mac(octets), 0, (0, 0), False, 0, 1, None, 0, octets)


def _frame(
    mac: bytes,
    its_ms: int,
    where: tuple[int, int],
    is_known: bool,
    traffic_class: int,
    hops: int,
    area: Area | None,
    port: int,
    pdu: bytes,
) -> bytes:
    kind = HeaderType.SHB if area is None else HeaderType.GBC_CIRCLE + area.shape
    hops = 1 if area is None else min(hops, 255)
    size = len(pdu) + btp.SIZE
    head = _HEAD.pack(
        _FIRST, _LIFETIME, hops, CommonNext.BTP_B << 4, kind, traffic_class & 0xFF, 0, size & 0xFFFF, hops
    )
    position = mac, gn_timestamp(its_ms), *where, _KNOWN * is_known, 0
    if area is None:
        rest = _SINGLE_HOP.pack(*position, port)
    else:
        (a, b, angle) = (area.distance_a, area.distance_b, area.angle)
        b, angle = (0, 0) if area.shape is Shape.CIRCLE else (b, angle)  # clause 9.8.5.2
        rest = _GEO_BROADCAST.pack(
            next(_sequence) & 0xFFFF, *position, *area.centre, a & 0xFFFF, b & 0xFFFF, angle & 0xFFFF, port
        )
    return frame.wrap(mac, head + rest + pdu)


def _mac(pdu: bytes) -> bytes:
    return _LOCAL + pdu[2:ITS_HEADER].ljust(4, b"\0")
