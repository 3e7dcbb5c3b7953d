"""MCAP read back, record by record, as the specification says it: no more than tests want to know."""

import struct
import zlib
from typing import NamedTuple

MAGIC = b"\x89MCAP0\r\n"


class Read(NamedTuple):
    """schemas and channels by number; messages as (channel, ns, octets); summary as its records' opcodes."""

    schemas: dict[int, tuple[str, str, str]]
    channels: dict[int, tuple[str, int, str]]
    messages: list[tuple[int, int, bytes]]
    summary: list[int]


def read(octets: bytes) -> Read:
    """A whole file; asserts what a reader relies on: check sums, offsets, indexes."""
    assert octets.startswith(MAGIC)
    assert octets.endswith(MAGIC)
    schemas, channels, messages = {}, {}, []
    outer = list(records(octets, len(MAGIC), len(octets) - len(MAGIC)))
    for _, opcode, content in outer:
        if opcode == 6:
            first, last, size, crc, word = struct.unpack_from("<QQQII", content)
            assert word == 0, "compressed"
            chunk = content[40:]
            assert (len(chunk), zlib.crc32(chunk)) == (size, crc)
            for _, kind, inner in records(chunk, 0, len(chunk)):
                if kind == 3:
                    number, (name, encoding, text) = struct.unpack_from("<H", inner)[0], _strings(inner[2:])
                    schemas[number] = name, encoding, text
                elif kind == 4:
                    number, schema = struct.unpack_from("<HH", inner)
                    topic, encoding, _ = _strings(inner[4:])
                    channels[number] = topic, schema, encoding
                elif kind == 5:
                    number, _, ns, _ = struct.unpack_from("<HIQQ", inner)
                    assert first <= ns <= last
                    messages.append((number, ns, inner[22:]))
        elif opcode == 7:
            for ns, offset in _pairs(content[6:]):
                assert struct.unpack_from("<BQHIQ", chunk, offset)[4] == ns
        elif opcode == 8:
            start, length = struct.unpack_from("<QQ", content, 16)
            assert octets[start] == 6
            assert struct.unpack_from("<Q", octets, start + 1)[0] + 9 == length
    at, opcode, footer = outer[-1]
    start, offsets, crc = struct.unpack("<QQI", footer)
    assert opcode == 2
    assert zlib.crc32(octets[start : at + 9 + 16]) == crc
    summary = [opcode for at, opcode, _ in outer if at >= start]
    for _, _, content in records(octets, offsets, at):
        kind, group, size = struct.unpack("<BQQ", content)
        assert {one for _, one, _ in records(octets, group, group + size)} <= {kind}
    return Read(schemas, channels, messages, summary)


def records(octets: bytes, at: int, end: int):
    while at < end:
        opcode, size = struct.unpack_from("<BQ", octets, at)
        yield at, opcode, octets[at + 9 : at + 9 + size]
        at += 9 + size


def _strings(octets: bytes) -> list[str]:
    found = []
    while octets:
        size = int.from_bytes(octets[:4], "little")
        found.append(octets[4 : 4 + size].decode("utf-8", "backslashreplace"))
        octets = octets[4 + size :]
    return found


def _pairs(octets: bytes) -> list[tuple[int, int]]:
    return list(struct.iter_unpack("<QQ", octets))
