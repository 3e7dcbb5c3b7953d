"""Serialiser of captain_gateway_msgs/msg/Metadata; fifty times as fast as building a typed message."""

import struct
from typing import NamedTuple

from .pairing import How, Reception

NAN = float("nan")
UNKNOWN = How("", 0, "")
NOTHING = Reception(0, 0, None, None, 0, 0, 0, 0, 0, 0, bytes(6))
LITTLE_ENDIAN = b"\0\1\0\0"  # encapsulation: XCDR1

# Fields from `sequence` to `source_mac`. The order of Metadata.msg makes them aligned without padding.
_TIMES = struct.Struct("<QiIiI")
_REST = struct.Struct("<ddddIHhH2xIBBBBB6s")


class Note(NamedTuple):
    """Facts about a published message, as known at publication."""

    sequence: int
    pdu: bytes
    reception: Reception | None
    edition: str
    left_out: tuple[str, ...]
    published_ns: int


def cdr(note: Note, how: How | None, frame: bytes) -> bytes:
    """Serialise captain_gateway_msgs/msg/Metadata.

    Argument `how` has the facts of the indication; None if it did not arrive.
    frame  frame_id in ASCII.
    """
    known, how = note.reception or NOTHING, how or UNKNOWN
    stamp_ns = known.received_ns or note.published_ns
    pdu = note.pdu
    out = bytearray(struct.pack("<iII", *_stamp(stamp_ns), len(frame) + 1))
    out += frame + b"\0"
    out += bytes(-len(out) % 8)
    out += _TIMES.pack(note.sequence, *_stamp(known.own_ns), *_stamp(note.published_ns))
    out += _REST.pack(
        *_degrees(known.own), *_degrees(known.sender),
        int.from_bytes(pdu[2:6], "big"), how.btp_port, known.rssi_dbm, known.data_rate, known.its_aid,
        pdu[1], pdu[0], known.traffic_class, known.hop_limit, known.security_status, known.source_mac,
    )  # fmt: skip
    for text in (note.edition, how.interface, how.source):
        _text(out, text)
    out += bytes(-len(out) % 4)
    out += len(note.left_out).to_bytes(4, "little")
    for text in note.left_out:
        _text(out, text)
    out += bytes(-len(out) % 4)
    out += len(pdu).to_bytes(4, "little") + pdu
    return LITTLE_ENDIAN + bytes(out)


def _stamp(ns: int) -> tuple[int, int]:
    """Return seconds and nanoseconds of builtin_interfaces/Time, limited to 32-bit seconds."""
    seconds, rest = divmod(ns, 1_000_000_000)
    return max(-(1 << 31), min((1 << 31) - 1, seconds)), rest


def _degrees(place: tuple[int, int] | None) -> tuple[float, float]:
    return (NAN, NAN) if place is None else (place[0] / 1e7, place[1] / 1e7)


def _text(out: bytearray, text: str) -> None:
    octets = text.encode() + b"\0"
    out += bytes(-len(out) % 4)
    out += len(octets).to_bytes(4, "little") + octets
