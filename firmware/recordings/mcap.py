"""MCAP recordings: written and read as a stream, uncompressed.

MCAP is the format of ROS 2, Foxglove and PlotJuggler. The package `mcap` would do the same, but imports lz4 and
zstandard: more compiled code than this whole program. Compressed files are refused; `mcap compress --compression none`
converts them. Source: the MCAP format specification, version 0.
"""

import struct
import zlib
from collections.abc import Iterator
from typing import BinaryIO, NamedTuple

from board.runtime.errors import ProtocolError

MAGIC = b"\x89MCAP0\r\n"
HEAD = MAGIC[:4]
MAX_RECORD = 64 << 20  # octets; chunks written here have 1 MiB, those of other recorders 4 MiB
# Opcodes of records, from the specification.
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = 1, 2, 3, 4, 5, 6, 7, 8
STATISTICS, SUMMARY_OFFSET, DATA_END = 0x0B, 0x0E, 0x0F
# Limits of a chunk. A truncated recording loses at most one chunk, and readers seek by chunks.
CHUNK_OCTETS, CHUNK_NS = 1 << 20, 2_000_000_000


_HEAD = struct.Struct("<BQ")  # head of a record: opcode and length


class RecordedMessage(NamedTuple):
    """Message of a recording.

    when_ns  Unix time of its reception in nanoseconds.
    topic    name of its topic.
    type     name of its schema; empty if unknown.
    octets   encoded message.
    """

    when_ns: int
    topic: str
    type: str
    octets: bytes


class _Index(NamedTuple):
    """Index of a chunk: its time range and place, and the place of each channel's message index behind it."""

    first_ns: int
    last_ns: int
    start: int
    length: int
    channels: dict[int, int]
    behind: int
    octets: int


class Mcap:
    """Writer of a recording to a stream, which must be at its start. close() completes it and leaves the stream open.

    profile  MCAP profile: "ros2".
    library  name and version of the writing program.
    counts   number of messages by channel.
    """

    def __init__(self, stream: BinaryIO, profile: str, library: str) -> None:
        self._stream = stream
        self._at = 0
        self._schemas: dict[str, tuple[int, bytes]] = {}
        self._channels: dict[int, bytes] = {}
        self.counts: dict[int, int] = {}
        self._chunk = bytearray()
        self._waiting: dict[int, list[tuple[int, int]]] = {}
        self._times: list[int] = []
        self._chunks: list[_Index] = []
        self._put(MAGIC + _record(HEADER, _string(profile) + _string(library)))

    def channel(self, topic: str, type_: str, definition: str, about: dict[str, str]) -> int:
        """Add a channel for a topic and return its number.

        type_       ROS 2 message type.
        definition  .msg text of the type and of all types inside it.
        about       metadata of the channel.
        """
        if type_ not in self._schemas:
            number = len(self._schemas) + 1
            content = struct.pack("<H", number) + _string(type_) + _string("ros2msg") + _string(definition)
            self._schemas[type_] = number, _record(SCHEMA, content)
            self._chunk += self._schemas[type_][1]
        number = len(self._channels) + 1
        pairs = b"".join(_string(key) + _string(value) for key, value in about.items())
        head = struct.pack("<HH", number, self._schemas[type_][0])
        self._channels[number] = _record(CHANNEL, head + _string(topic) + _string("cdr") + _sized(pairs))
        self._chunk += self._channels[number]
        self.counts[number] = 0
        return number

    def add(self, channel: int, received_ns: int, cdr: bytes) -> None:
        """Add one encoded message to a channel; received_ns: Unix time in nanoseconds."""
        self._waiting.setdefault(channel, []).append((received_ns, len(self._chunk)))
        head = struct.pack("<HIQQ", channel, self.counts[channel] & 0xFFFFFFFF, received_ns, received_ns)
        self._chunk += _record(MESSAGE, head + cdr)
        self._times.append(received_ns)
        self.counts[channel] += 1
        if len(self._chunk) >= CHUNK_OCTETS or abs(received_ns - self._times[0]) >= CHUNK_NS:
            self.flush()

    def flush(self) -> None:
        """Write all buffered messages to the stream as one chunk."""
        if self._times:
            chunk, first, last = bytes(self._chunk), min(self._times), max(self._times)
            head = struct.pack("<QQQI", first, last, len(chunk), zlib.crc32(chunk)) + _string("")
            start = self._at
            self._put(_record(CHUNK, head + struct.pack("<Q", len(chunk)) + chunk))
            end = self._at
            offsets = {}
            for channel, rows in self._waiting.items():
                offsets[channel] = self._at
                pairs = b"".join(struct.pack("<QQ", *row) for row in rows)
                self._put(_record(MESSAGE_INDEX, struct.pack("<H", channel) + _sized(pairs)))
            self._chunks.append(_Index(first, last, start, end - start, offsets, self._at - end, len(chunk)))
            self._chunk.clear()
            self._waiting.clear()
            self._times.clear()
        self._stream.flush()

    def close(self) -> None:
        """Write the buffered messages, and the summary by which readers seek."""
        self.flush()
        self._put(_record(DATA_END, bytes(4)))
        start = self._at
        groups = {
            SCHEMA: b"".join(record for _, record in self._schemas.values()),
            CHANNEL: b"".join(self._channels.values()),
            STATISTICS: self._statistics(),
            CHUNK_INDEX: b"".join(_chunk_index(index) for index in self._chunks),
        }
        summary, offsets = b"".join(groups.values()), b""
        at = start
        for opcode, records in groups.items():
            offsets += _record(SUMMARY_OFFSET, struct.pack("<BQQ", opcode, at, len(records)))
            at += len(records)
        # The checksum covers the summary and the footer up to the checksum itself.
        footer = struct.pack("<BQQQ", FOOTER, 20, start, at)
        sum_ = zlib.crc32(summary + offsets + footer)
        self._put(summary + offsets + footer + struct.pack("<I", sum_) + MAGIC)
        self._stream.flush()

    def _statistics(self) -> bytes:
        pairs = b"".join(struct.pack("<HQ", channel, count) for channel, count in self.counts.items())
        first = min((index.first_ns for index in self._chunks), default=0)
        last = max((index.last_ns for index in self._chunks), default=0)
        head = struct.pack(
            "<QHIIIIQQ", sum(self.counts.values()), len(self._schemas), len(self._channels), 0, 0, len(self._chunks),
            first, last,
        )  # fmt: skip
        return _record(STATISTICS, head + _sized(pairs))

    def _put(self, octets: bytes) -> None:
        self._stream.write(octets)
        self._at += len(octets)


def _chunk_index(index: _Index) -> bytes:
    pairs = b"".join(struct.pack("<HQ", channel, at) for channel, at in index.channels.items())
    head = struct.pack("<QQQQ", index.first_ns, index.last_ns, index.start, index.length)
    tail = struct.pack("<Q", index.behind) + _string("") + struct.pack("<QQ", index.octets, index.octets)
    return _record(CHUNK_INDEX, head + _sized(pairs) + tail)


def _record(opcode: int, content: bytes) -> bytes:
    return _HEAD.pack(opcode, len(content)) + content


def _string(text: str) -> bytes:
    return _sized(text.encode())


def _sized(octets: bytes) -> bytes:
    return struct.pack("<I", len(octets)) + octets


def messages(head: bytes, stream: BinaryIO) -> Iterator[RecordedMessage]:
    """Yield the messages of a recording.

    head    first four octets, which the caller has already read.
    stream  the rest of the file.

    Raises ProtocolError if the file is truncated or inconsistent.
    """
    if head + stream.read(len(MAGIC) - len(head)) != MAGIC:
        raise ProtocolError("not an MCAP file of version 0")
    schemas, channels = dict[int, str](), dict[int, tuple[str, str]]()
    try:
        for opcode, content in _records(stream):
            if opcode == SCHEMA:
                (one,) = struct.unpack_from("<H", content)
                schemas[one] = _text(content, 2)[0]
            elif opcode == CHANNEL:
                one, schema = struct.unpack_from("<HH", content)
                channels[one] = _text(content, 4)[0], schemas.get(schema, "")
            elif opcode == MESSAGE:
                one, _, when_ns = struct.unpack_from("<HIQ", content)
                topic, type_ = channels.get(one, (f"channel {one}", ""))
                yield RecordedMessage(when_ns, topic, type_, content[22:])
    except (struct.error, IndexError) as error:
        raise ProtocolError(f"truncated record: {error}") from error


def _records(stream: BinaryIO) -> Iterator[tuple[int, bytes]]:
    """Yield opcode and content of each record, including those inside chunks, up to the end of the messages.

    Raises ProtocolError for a truncated or malformed record.
    """
    while head := stream.read(_HEAD.size):
        opcode, length = _HEAD.unpack(head) if len(head) == _HEAD.size else (0, MAX_RECORD + 1)
        content = stream.read(length) if length <= MAX_RECORD else b""
        if len(content) < length:
            raise ProtocolError("truncated or malformed record")
        if opcode == DATA_END:
            return
        if opcode == CHUNK:
            yield from _chunk(content)
        else:
            yield opcode, content


def _chunk(content: bytes) -> Iterator[tuple[int, bytes]]:
    compression, at = _text(content, 28)
    if compression:
        raise ProtocolError(f"its chunks are compressed with {compression}, which is not read here")
    at += 8
    while at < len(content):
        opcode, length = _HEAD.unpack_from(content, at)
        at += _HEAD.size
        if at + length > len(content):
            raise ProtocolError("record exceeds its chunk")
        yield opcode, content[at : at + length]
        at += length


def _text(octets: bytes, at: int) -> tuple[str, int]:
    """Return a string and the offset of its end."""
    (length,) = struct.unpack_from("<I", octets, at)
    return octets[at + 4 : at + 4 + length].decode(errors="replace"), int(at + 4 + length)
