"""captain_gateway_msgs/msg/Metadata: what is known of a received message, beside it, as the gateway publishes it.

Written here for recordings; the gateway, which is a program of its own, has a writer of its own. tests/firmware/user
compares DEFINITION with the gateway's .msg file.
"""

import math
import struct

from drivers.message import NO_RX_INFO, Position
from firmware.user.received import Message

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

# From `sequence` to `source_mac`: aligned with nothing between.
_TIMES = struct.Struct("<QiIiI")
_REST = struct.Struct("<ddddIHhH2xIBBBBB6s")


def cdr(message: Message, received_ns: int, sequence: int, edition: str) -> bytes:
    """Encapsulation and all.

    received_ns  Unix time of the reception, which is the stamp.
    sequence     of the message on its own topic, from 1; 0 where the message is in the recording only here.
    edition      "cam-1.4.1"; empty where none takes it.
    """
    raw, pdu = message.raw, message.pdu
    rx = NO_RX_INFO if raw is None else raw.rx
    own_ns, own = (0, Position()) if raw is None or raw.local is None else raw.local
    out = bytearray(struct.pack("<iII", *_time(received_ns), len(FRAME)) + FRAME)
    out += bytes(-len(out) % 8)
    out += _TIMES.pack(sequence, *_time(own_ns), *_time(received_ns))
    out += _REST.pack(
        *_degrees(own), *_degrees(rx.position), message.station_id or 0, rx.btp_port or 0, rx.rssi_dbm or 0,
        rx.data_rate, rx.security.its_aid, message.message_id or 0, pdu[0] if pdu else 0, rx.traffic_class,
        rx.hop_limit, rx.security.status, rx.source_mac,
    )  # fmt: skip
    for text in (edition, "", rx.source):
        _sized(out, text.encode() + b"\0")
    _sized(out, b"")  # left_out: nothing that compiled code has told
    _sized(out, pdu)
    return b"\0\1\0\0" + out


def _time(ns: int) -> tuple[int, int]:
    """builtin_interfaces/Time, whose seconds have 32 bits."""
    seconds, rest = divmod(ns, 1_000_000_000)
    return max(-(1 << 31), min((1 << 31) - 1, seconds)), rest


def _degrees(place: Position) -> tuple[float, float]:
    """RawRxMessage has 0, 0 where nothing is known."""
    return (math.nan, math.nan) if place == (0, 0) else (place.latitude / 1e7, place.longitude / 1e7)


def _sized(out: bytearray, octets: bytes) -> None:
    out += bytes(-len(out) % 4)
    out += len(octets).to_bytes(4, "little") + octets
