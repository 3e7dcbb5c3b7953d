"""MCAP, the form of recording of ROS 2, Foxglove and PlotJuggler; written as it comes, not compressed.

The package `mcap` does the same with lz4 and zstandard, which it imports: more octets of compiled code than all of this
program's own. Source: the MCAP format specification, version 0.
"""

import struct
import zlib
from typing import BinaryIO, NamedTuple

MAGIC = b"\x89MCAP0\r\n"
# Records: opcodes of the specification.
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = 1, 2, 3, 4, 5, 6, 7, 8
STATISTICS, SUMMARY_OFFSET, DATA_END = 0x0B, 0x0E, 0x0F
# What is lost of a recording that is cut off; a reader's cursor moves by chunks.
CHUNK_OCTETS, CHUNK_NS = 1 << 20, 2_000_000_000


class _Index(NamedTuple):
    """Of a chunk: when and where it is; where the index of each channel behind it is, and how long these are."""

    first_ns: int
    last_ns: int
    start: int
    length: int
    channels: dict[int, int]
    behind: int
    octets: int


class Mcap:
    """A recording into a stream, which has to be at its beginning; close() makes it whole and leaves the stream open.

    profile  "ros2"
    library  which program has written it
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
        """Its number. type_ and definition: a ROS 2 message and its .msg with those that it holds; about: metadata."""
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
        """One message; its time is Unix time."""
        self._waiting.setdefault(channel, []).append((received_ns, len(self._chunk)))
        head = struct.pack("<HIQQ", channel, self.counts[channel] & 0xFFFFFFFF, received_ns, received_ns)
        self._chunk += _record(MESSAGE, head + cdr)
        self._times.append(received_ns)
        self.counts[channel] += 1
        if len(self._chunk) >= CHUNK_OCTETS or abs(received_ns - self._times[0]) >= CHUNK_NS:
            self.flush()

    def flush(self) -> None:
        """What has come goes into the stream."""
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
        """Writes what waits, and the summary by which readers find their way."""
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
        # The check sum goes up to itself, in the footer.
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
    return struct.pack("<BQ", opcode, len(content)) + content


def _string(text: str) -> bytes:
    return _sized(text.encode())


def _sized(octets: bytes) -> bytes:
    return struct.pack("<I", len(octets)) + octets
