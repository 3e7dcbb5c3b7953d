"""Messages of MCAP files, read while they come: PDUs of the topic of metadata that `captain record --mcap` writes.

Source: the MCAP format specification, version 0. What is compressed is refused: this program has neither lz4 nor
zstandard (`mcap compress --compression none` writes it anew).
"""

import struct
from collections import Counter
from collections.abc import Iterator
from typing import BinaryIO, NamedTuple

from board.errors import ProtocolError
from firmware.user import mcap, reception

HEAD = mcap.MAGIC[:4]
MAX_RECORD = 64 << 20  # octets; ours have 1 MiB, those of other recorders 4 MiB
_HEAD = struct.Struct("<BQ")
_METADATA = struct.Struct("<QiIiIddddIHhH2xIBBBBB6s")


class Received(NamedTuple):
    """One message. number counts those of the topics of metadata from 1; port is 0 where it is not known."""

    number: int
    when_ns: int
    pdu: bytes
    port: int
    source_mac: bytes


def messages(head: bytes, stream: BinaryIO, skipped: Counter[str]) -> Iterator[Received]:
    """The messages of a recording; head is its first four octets, which were read already.

    skipped  is told of the topics that hold no octets of PDUs: those with the same messages as ROS types among them.

    Raises ProtocolError where it is cut off or contradicts itself.
    """
    if head + stream.read(len(mcap.MAGIC) - len(head)) != mcap.MAGIC:
        raise ProtocolError("it does not begin as MCAP of version 0 does")
    try:
        yield from _messages(_records(stream), skipped)
    except (struct.error, IndexError) as error:
        raise ProtocolError(f"a record of it ends too early: {error}") from error


def _messages(records: Iterator[tuple[int, bytes]], skipped: Counter[str]) -> Iterator[Received]:
    schemas, channels, number = dict[int, str](), dict[int, tuple[str, str]](), 0
    for opcode, content in records:
        if opcode == mcap.SCHEMA:
            (one,) = struct.unpack_from("<H", content)
            schemas[one] = _string(content, 2)[0]
        elif opcode == mcap.CHANNEL:
            one, schema = struct.unpack_from("<HH", content)
            channels[one] = schemas.get(schema, ""), _string(content, 4)[0]
        elif opcode == mcap.MESSAGE:
            one, _, when_ns = struct.unpack_from("<HIQ", content)
            kind, topic = channels.get(one, ("", f"channel {one}"))
            if kind != reception.TYPE:
                skipped[f"of topic {topic}, which has no octets of PDUs"] += 1
                continue
            number += 1
            yield _received(number, when_ns, content[22:])


def _records(stream: BinaryIO) -> Iterator[tuple[int, bytes]]:
    """Opcode and content of each, those inside of chunks among them, up to the end of the messages."""
    while head := stream.read(_HEAD.size):
        opcode, length = _HEAD.unpack(head) if len(head) == _HEAD.size else (0, MAX_RECORD + 1)
        content = stream.read(length) if length <= MAX_RECORD else b""
        if len(content) < length:
            raise ProtocolError("it is cut off, or a record of it is none")
        if opcode == mcap.DATA_END:
            return
        if opcode == mcap.CHUNK:
            yield from _chunk(content)
        else:
            yield opcode, content


def _chunk(content: bytes) -> Iterator[tuple[int, bytes]]:
    compression, at = _string(content, 28)
    if compression:
        raise ProtocolError(f"its chunks are compressed with {compression}, which is not read here")
    at += 8
    while at < len(content):
        opcode, length = _HEAD.unpack_from(content, at)
        at += _HEAD.size
        if at + length > len(content):
            raise ProtocolError("a record goes beyond the end of its chunk")
        yield opcode, content[at : at + length]
        at += length


def _received(number: int, when_ns: int, cdr: bytes) -> Received:
    """From captain_gateway_msgs/msg/Metadata, as reception.cdr() writes it; places count from behind the four octets
    of encapsulation.
    """
    if cdr[:2] != b"\0\1":
        raise ProtocolError(f"message {number} is encapsulated as {cdr[:2].hex()}, not little-endian CDR")
    body = cdr[4:]
    (length,) = struct.unpack_from("<I", body, 8)
    at = -(-(12 + length) // 8) * 8
    fields = _METADATA.unpack_from(body, at)
    at += _METADATA.size
    for _ in range(3):  # edition, interface, source
        at = _behind(body, at)
    at = -(-at // 4) * 4
    (count,) = struct.unpack_from("<I", body, at)
    at += 4
    for _ in range(min(count, len(body))):  # left_out
        at = _behind(body, at)
    at = -(-at // 4) * 4
    (size,) = struct.unpack_from("<I", body, at)
    pdu = body[at + 4 : at + 4 + size]
    if len(pdu) < size:
        raise ProtocolError(f"message {number} claims {size} octets and has {len(pdu)}")
    return Received(number, when_ns, pdu, fields[10], fields[-1])


def _behind(octets: bytes, at: int) -> int:
    """Where a string of CDR ends that begins at the next multiple of 4."""
    at = -(-at // 4) * 4
    (length,) = struct.unpack_from("<I", octets, at)
    return int(at + 4 + length)


def _string(octets: bytes, at: int) -> tuple[str, int]:
    (length,) = struct.unpack_from("<I", octets, at)
    return octets[at + 4 : at + 4 + length].decode(errors="replace"), int(at + 4 + length)
