"""Structs of the V2Xcast library, and messages between the station and the process that loads the library.

The structs have the vendor's layout with natural alignment (V2Xcast SDK 1.7 to 1.13). The messages are our own: an
octet with their type, then fields, then the rest. Both ends run on one machine: numbers are in native byte order.

    station to process              process to station
    settings as JSON, first         RECEIVED  caster, time, rx_info, PDU
    SEND   caster, number,          SENT      number, error (empty: the PDU was sent)
           tx_info, PDU             STATE     caster, mode, error (empty: the caster works)
    COUNT  requests COUNTED         NOTE      text for the log
                                    COUNTED   number of messages dropped since the last COUNTED
                                    FAULT     flag "the library itself is unusable", text, blank line, remedy
                                    ALIVE     sent within CHECK_S of watchdog.py if no other message is
"""

import struct
from struct import Struct
from typing import NamedTuple

from board.runtime.errors import RequestError
from drivers.message import NOT_SECURED, Area, Position, Request, RxInfo, Security, SecurityStatus, Shape

TX, RX = 0, 1  # mode of a caster's handler
MAX_PAYLOAD = 1500  # octets of a PDU

SEND, COUNT = 1, 2
RECEIVED, SENT, STATE, NOTE, COUNTED, FAULT, ALIVE = 1, 2, 3, 4, 5, 6, 7

# Fields: struct timeval; rssi in dBm; data rate in 500 kbit/s; traffic class; remaining hop limit; security: status,
# ITS-AID, length of the SSP, SSP; position in 1e-7 degree; area: type, distances in m, angle in degrees from north;
# MAC. The struct has 96 octets on 64-bit machines.
RX_INFO = Struct("@llhHBBIIB32s3xiiIHHH2x6s0l")

# Fields: BTP port, data rate, power in dBm, traffic class; security as above; centre and area; seven flags that mark
# port, rate, power, class, security, position and area as valid. The struct has 80 octets.
TX_INFO = Struct("@HBbB3xIIB32s3xiiIHHH2x7?0I")

ALIVE_NOW = bytes((ALIVE,))  # complete ALIVE message

_SEND = Struct("=BBQ")
_RECEIVED = Struct("=BBq")
_SENT = Struct("=BQ")
_STATE = Struct("=BBB")
_COUNTED = Struct("=BI")
_FAULT = Struct("=B?")

# Traffic class ID: the lower six bits of the octet in the common header (EN 302 636-4-1 V1.4.1 clause 9.7.5).
_CLASS = 0x3F

_NOWHERE = Area(Shape.CIRCLE, Position(), 0)

# Limits of the module's time stamp, relative to our time when the library delivers the message. The module's clock
# follows its own receiver. A time stamp beyond these limits means that its clock or ours is not set.
OLDEST_NS = 2_000_000_000
NEWEST_NS = 100_000_000


def send(caster: int, request: Request) -> bytes:
    """Return the SEND message of a request; caster is an index in the settings.

    tx_info holds the port, traffic class and area of the request. It has no field for hop limit and lifetime: the
    profile on the module decides them. Raises RequestError if a number is out of range.
    """
    area = request.area or _NOWHERE
    has_area = request.area is not None
    try:
        info = TX_INFO.pack(
            request.btp_port,
            *(0, 0, request.traffic_class & _CLASS),
            *(0, 0, 0, b""),
            *area.centre,
            *(area.shape, area.distance_a, area.distance_b, area.angle),
            *(True, False, False, True, False, has_area, has_area),
        )
    except struct.error as error:
        raise RequestError(f"V2Xcast: {error}; port {request.btp_port}, {request.area}") from error
    return _SEND.pack(SEND, caster, request.number) + info + request.pdu


class ToSend(NamedTuple):
    """Parsed SEND message; tx_info is the library's struct."""

    caster: int
    number: int
    tx_info: bytes
    pdu: bytes


def to_send(message: bytes) -> ToSend:
    _, caster, number = _SEND.unpack_from(message)
    start = _SEND.size + TX_INFO.size
    return ToSend(caster, number, message[_SEND.size : start], message[start:])


def received(caster: int, now_ns: int, rx_info: bytes, pdu: bytes) -> bytes:
    """Return the RECEIVED message of a PDU; now_ns is the Unix time when the library delivered it."""
    return _RECEIVED.pack(RECEIVED, caster, now_ns) + rx_info + pdu


class Received(NamedTuple):
    """Parsed RECEIVED message.

    caster       index in the settings.
    received_ns  Unix time of reception.
    rx           properties of the reception, without the BTP port.
    """

    caster: int
    received_ns: int
    pdu: bytes
    rx: RxInfo


def parse_received(message: bytes) -> Received:
    """Parse a RECEIVED message; values that no standard allows become "unknown"."""
    _, caster, now_ns = _RECEIVED.unpack_from(message)
    rx, stamp_ns = parse_rx_info(message, _RECEIVED.size)
    is_plausible = -OLDEST_NS <= stamp_ns - now_ns <= NEWEST_NS
    pdu = message[_RECEIVED.size + RX_INFO.size :]
    return Received(caster, stamp_ns if is_plausible else now_ns, pdu, rx)


def parse_rx_info(octets: bytes, at: int = 0) -> tuple[RxInfo, int]:
    """Parse an rx_info: return it without BTP port, and its time stamp as Unix time in ns."""
    (seconds, microseconds, rssi, rate, traffic_class, hops, status, its_aid, size, ssp) = (
        fields := RX_INFO.unpack_from(octets, at)
    )[:10]
    latitude, longitude, kind, distance_a, distance_b, angle, mac = fields[10:]
    area = None
    if kind <= Shape.ELLIPSE and (kind or distance_a or distance_b or angle):
        area = Area(Shape(kind), Position(), distance_a, distance_b, angle)
    security = NOT_SECURED
    if 0 < status <= SecurityStatus.UNVERIFIABLE_PKT:
        security = Security(SecurityStatus(status), its_aid, ssp[:size])
    position = Position(latitude, longitude)
    rx = RxInfo(None, rssi or None, rate, traffic_class, hops, security, position, area, mac)
    return rx, seconds * 1_000_000_000 + microseconds * 1000


def sent(number: int, why_not: str = "") -> bytes:
    return _SENT.pack(SENT, number) + why_not.encode()


def parse_sent(message: bytes) -> tuple[int, str]:
    return int(_SENT.unpack_from(message)[1]), message[_SENT.size :].decode()


def state(caster: int, mode: int, why_not: str = "") -> bytes:
    return _STATE.pack(STATE, caster, mode) + why_not.encode()


def parse_state(message: bytes) -> tuple[int, int, str]:
    _, caster, mode = _STATE.unpack_from(message)
    return caster, mode, message[_STATE.size :].decode()


def note(text: str) -> bytes:
    return bytes((NOTE,)) + text.encode()


def parse_note(message: bytes) -> str:
    return message[1:].decode()


def counted(dropped: int) -> bytes:
    return _COUNTED.pack(COUNTED, dropped)


def parse_counted(message: bytes) -> int:
    return int(_COUNTED.unpack_from(message)[1])


def fault(is_library: bool, message: str, hint: str = "") -> bytes:
    return _FAULT.pack(FAULT, is_library) + f"{message}\n\n{hint}".encode()


def parse_fault(message: bytes) -> tuple[bool, str, str]:
    text, _, hint = message[_FAULT.size :].decode().partition("\n\n")
    return bool(_FAULT.unpack_from(message)[1]), text, hint
