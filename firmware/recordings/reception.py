"""Metadata of reception in MCAP: captain_gateway_msgs/msg/Metadata, as the gateway publishes it.

This module writes and reads it in recordings; the gateway is a separate program with its own writer.
tests/firmware/recordings compares DEFINITION with the gateway's .msg file.
"""

import math
import struct
from collections import Counter
from collections.abc import Iterator
from typing import BinaryIO, NamedTuple

from board.runtime.errors import ProtocolError
from drivers.message import NO_RX_INFO, Position
from firmware.client.received import Message
from firmware.recordings import mcap

TYPE = "captain_gateway_msgs/msg/Metadata"
DEFINITION = """\
uint8 UNKNOWN = 0
uint8 INVALID_FORMAT = 1
uint8 VERIFIED = 2
uint8 UNVERIFIABLE = 3
std_msgs/Header header
uint64 sequence
builtin_interfaces/Time station_time
builtin_interfaces/Time gateway_time
float64 own_latitude
float64 own_longitude
float64 sender_latitude
float64 sender_longitude
uint32 station_id
uint16 btp_port
int16 rssi_dbm
uint16 data_rate
uint32 security_its_aid
uint8 message_id
uint8 protocol_version
uint8 traffic_class
uint8 remaining_hop_limit
uint8 security_status
uint8[6] source_mac
string edition
string interface
string source
string[] left_out
uint8[] pdu
"""
_RULE = "=" * 80
_PARTS = (
    ("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n"),
    ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n"),
)
SCHEMA = DEFINITION + "".join(f"{_RULE}\nMSG: {name}\n{text}" for name, text in _PARTS)
FRAME = b"captain\0"

# Fields from `sequence` to `source_mac`, which CDR aligns without gaps.
_TIMES = struct.Struct("<QiIiI")
_REST = struct.Struct("<ddddIHhH2xIBBBBB6s")


class Reception(NamedTuple):
    """Received message of a recording.

    number      number in the recording, from 1.
    when_ns     Unix time of the reception in nanoseconds.
    port        BTP port; 0 if unknown.
    source_mac  address of the sender.
    """

    number: int
    when_ns: int
    pdu: bytes
    port: int
    source_mac: bytes


def cdr(message: Message, received_ns: int, sequence: int, edition: str) -> bytes:
    """Return the metadata of a message as CDR with its encapsulation header.

    received_ns  Unix time of the reception in nanoseconds, used as stamp.
    sequence     number of the message on its own topic, from 1; 0 if the recording has it only as metadata.
    edition      edition that decodes the message, such as "cam-1.4.1"; empty if none does.
    """
    raw, pdu = message.raw, message.pdu
    rx = NO_RX_INFO if raw is None else raw.rx
    own_ns, own = (0, Position()) if raw is None or raw.local is None else raw.local
    out = bytearray(struct.pack("<iII", *_time(received_ns), len(FRAME)) + FRAME)
    out += bytes(-len(out) % 8)
    out += _TIMES.pack(sequence, *_time(own_ns), *_time(received_ns))
    out += _REST.pack(
        *_degrees(own), *_degrees(rx.position), message.station or 0, rx.btp_port or 0, rx.rssi_dbm or 0,
        rx.data_rate, rx.security.its_aid, message.message_id or 0, pdu[0] if pdu else 0, rx.traffic_class,
        rx.hop_limit, rx.security.status, rx.source_mac,
    )  # fmt: skip
    for text in (edition, "", rx.source):
        _sized(out, text.encode() + b"\0")
    _sized(out, b"")  # left_out stays empty: only the gateway's compiled code fills it
    _sized(out, pdu)
    return b"\0\1\0\0" + out


def receptions(head: bytes, stream: BinaryIO, skipped: Counter[str]) -> Iterator[Reception]:
    """Yield the received messages of an MCAP recording, from its metadata topics.

    head     first four octets, as for mcap.messages().
    skipped  counts messages of other topics, which contain no PDU octets; the decoded messages are among them.

    Raises ProtocolError like mcap.messages(), and for metadata in another form than that of cdr().
    """
    number = 0
    for one in mcap.messages(head, stream):
        if one.type != TYPE:
            skipped[f"on topic {one.topic}, without octets of PDUs"] += 1
            continue
        number += 1
        try:
            yield _parsed(number, one.when_ns, one.octets)
        except (struct.error, IndexError) as error:
            raise ProtocolError(f"a record of it ends too early: {error}") from error


def _parsed(number: int, when_ns: int, octets: bytes) -> Reception:
    """Return the inverse of cdr(). Offsets count from behind the four octets of encapsulation. Raises ProtocolError."""
    if octets[:2] != b"\0\1":
        raise ProtocolError(f"message {number} is encapsulated as {octets[:2].hex()}, not little-endian CDR")
    body = octets[4:]
    at = -(-_behind(body, 8) // 8) * 8 + _TIMES.size
    fields = _REST.unpack_from(body, at)
    at += _REST.size
    for _ in range(3):  # skips the strings edition, interface and source
        at = _behind(body, at)
    at = -(-at // 4) * 4
    (count,) = struct.unpack_from("<I", body, at)
    at += 4
    for _ in range(min(count, len(body))):  # skips the strings of left_out
        at = _behind(body, at)
    at = -(-at // 4) * 4
    (size,) = struct.unpack_from("<I", body, at)
    pdu = body[at + 4 : at + 4 + size]
    if len(pdu) < size:
        raise ProtocolError(f"message {number} claims {size} octets and has {len(pdu)}")
    return Reception(number, when_ns, pdu, fields[5], fields[-1])


def _behind(octets: bytes, at: int) -> int:
    """Return the end of a CDR string that begins at the next multiple of 4."""
    at = -(-at // 4) * 4
    (length,) = struct.unpack_from("<I", octets, at)
    return int(at + 4 + length)


def _time(ns: int) -> tuple[int, int]:
    """Return a builtin_interfaces/Time as seconds, limited to 32 bits, and nanoseconds."""
    seconds, rest = divmod(ns, 1_000_000_000)
    return max(-(1 << 31), min((1 << 31) - 1, seconds)), rest


def _degrees(place: Position) -> tuple[float, float]:
    """Return latitude and longitude in degrees; NaN for 0, 0, which means unknown in RawRxMessage."""
    return (math.nan, math.nan) if place == (0, 0) else (place.latitude / 1e7, place.longitude / 1e7)


def _sized(out: bytearray, octets: bytes) -> None:
    out += bytes(-len(out) % 4)
    out += len(octets).to_bytes(4, "little") + octets
