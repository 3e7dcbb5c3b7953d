"""Messages between station and MQTT process: an octet with the kind, then fields.

Both ends run on one machine, so numbers are in native byte order. Deadlines are times of the common clock,
CLOCK_MONOTONIC.

    station to process                        process to station
    settings as JSON, first                   RECEIVED  Unix time in ns, BTP port, source, PDU
    SEND    number, deadline, port, row, PDU  SENT      number, outcome, its cause as text
    EGO     own state                         STATE     link to the broker: up, starting or down; cause as text
    BEARER  True if it is up, its device      DROPPED   reason, count, sample, cause as text
    LEAVE   orderly end: disconnect           DETAILS   JSON, as Host.report_details() takes it
                                              FAULT     text, a blank line, remedy: it cannot work as configured
                                              ALIVE     sent within BEAT_S if no other message is
"""

import json
import struct
from collections.abc import Mapping
from struct import Struct
from typing import NamedTuple

from drivers.message import Ego, Position
from drivers.reason import Reason
from drivers.wire.v2n.message import ReceivedPdu

SEND, EGO, BEARER, LEAVE = 1, 2, 3, 4
RECEIVED, SENT, STATE, DROPPED, DETAILS, FAULT, ALIVE = 1, 2, 3, 4, 5, 6, 7

BEAT_S = 1.0
ALIVE_NOW = bytes((ALIVE,))  # complete ALIVE message
LEAVE_NOW = bytes((LEAVE,))  # complete LEAVE message; without it, the closed channel means a killed station
MAX_SAMPLE = 64  # octets of a dropped message that are reported

_SEND = Struct("=BQdHB")
_EGO = Struct("=Bqii?ii?")
_BEARER = Struct("=B?")
_RECEIVED = Struct("=BqiB")
_SENT = Struct("=BQB")
_STATE = Struct("=B??")
_DROPPED = Struct("=BBIB")
_NO_PORT = -1
_REASONS = tuple(Reason)


class ToSend(NamedTuple):
    """Parsed SEND message.

    deadline  time of CLOCK_MONOTONIC after which the message must not be sent.
    row       index in the table of message types in the settings.
    """

    number: int
    deadline: float
    btp_port: int
    row: int
    pdu: bytes


def send(request: ToSend) -> bytes:
    number, deadline, btp_port, row, pdu = request
    return _SEND.pack(SEND, number, deadline, btp_port, row) + pdu


def parse_send(message: bytes) -> ToSend:
    _, number, deadline, btp_port, row = _SEND.unpack_from(message)
    return ToSend(number, deadline, btp_port, row, message[_SEND.size :])


def ego(own: Ego) -> bytes:
    latitude, longitude = own.position
    return _EGO.pack(EGO, own.its_ms, latitude, longitude, own.is_known, own.speed, own.heading, own.is_accurate)


def parse_ego(message: bytes) -> Ego:
    _, its_ms, latitude, longitude, is_known, speed, heading, is_accurate = _EGO.unpack(message)
    return Ego(its_ms, Position(latitude, longitude), is_known, speed, heading, is_accurate)


def bearer(is_up: bool, device: str) -> bytes:
    return _BEARER.pack(BEARER, is_up) + device.encode()


def parse_bearer(message: bytes) -> tuple[bool, str]:
    return bool(_BEARER.unpack_from(message)[1]), message[_BEARER.size :].decode()


def received(moment_ns: int, what: ReceivedPdu) -> bytes:
    """Return a RECEIVED message. moment_ns: Unix time at which the broker delivered the PDU."""
    pdu, btp_port, source = what
    name = source.encode()
    return _RECEIVED.pack(RECEIVED, moment_ns, _NO_PORT if btp_port is None else btp_port, len(name)) + name + pdu


def parse_received(message: bytes) -> tuple[int, ReceivedPdu]:
    _, moment_ns, port, size = _RECEIVED.unpack_from(message)
    start = _RECEIVED.size + size
    source = message[_RECEIVED.size : start].decode()
    return moment_ns, ReceivedPdu(message[start:], None if port == _NO_PORT else port, source)


def sent(number: int, reason: Reason | None = None, why: str = "") -> bytes:
    """Return a SENT message.

    reason  None if the broker has acknowledged the message (QoS 1 and 2), or if it was sent (QoS 0).
    """
    outcome = len(_REASONS) if reason is None else _REASONS.index(reason)
    return _SENT.pack(SENT, number, outcome) + why.encode()


def parse_sent(message: bytes) -> tuple[int, Reason | None, str]:
    _, number, outcome = _SENT.unpack_from(message)
    return number, None if outcome == len(_REASONS) else _REASONS[outcome], message[_SENT.size :].decode()


class Link(NamedTuple):
    """Link to the broker.

    why          cause as text.
    is_starting  True if not up before the first answer of the broker, as opposed to a fault.
    """

    is_up: bool
    why: str
    is_starting: bool = False


def state(is_up: bool, why: str, is_starting: bool = False) -> bytes:
    return _STATE.pack(STATE, is_up, is_starting) + why.encode()


def parse_state(message: bytes) -> Link:
    _, is_up, is_starting = _STATE.unpack_from(message)
    return Link(is_up, message[_STATE.size :].decode(), is_starting)


def dropped(reason: Reason, count: int, sample: bytes = b"", why: str = "") -> bytes:
    """Return a DROPPED message.

    why  details of the last dropped message, beyond the reason. Characters that UTF-8 cannot encode are escaped.
    """
    kept = sample[:MAX_SAMPLE]
    head = _DROPPED.pack(DROPPED, _REASONS.index(reason), count, len(kept))
    return head + kept + why.encode(errors="backslashreplace")


def parse_dropped(message: bytes) -> tuple[Reason, int, bytes, str]:
    _, place, count, size = _DROPPED.unpack_from(message)
    start = _DROPPED.size + size
    return _REASONS[place], count, message[_DROPPED.size : start], message[start:].decode()


def details(what: Mapping[str, object]) -> bytes:
    return struct.pack("=B", DETAILS) + json.dumps(what).encode()


def parse_details(message: bytes) -> dict[str, object]:
    found: dict[str, object] = json.loads(message[1:])
    return found


def fault(message: str, hint: str = "") -> bytes:
    return struct.pack("=B", FAULT) + f"{message}\n\n{hint}".encode()


def parse_fault(message: bytes) -> tuple[str, str]:
    text, _, hint = message[1:].decode().partition("\n\n")
    return text, hint
