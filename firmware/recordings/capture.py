"""Frames of capture files, pcap and pcapng, parsed while the stream arrives.

Own code, because no library that reads both fits: dpkt is unmaintained (last release 2022), scapy is large. Sources:
draft-ietf-opsawg-pcap, draft-ietf-opsawg-pcapng.
"""

import json
import struct
from collections.abc import Iterable, Iterator, Mapping
from types import MappingProxyType
from typing import BinaryIO, NamedTuple

from board.runtime.errors import ProtocolError, RequestError
from firmware.recordings import pcapng
from firmware.recordings.pcapng import Direction

# First four octets of a file -> byte order, and unit of the time stamps in nanoseconds.
PCAP = {
    b"\xd4\xc3\xb2\xa1": ("<", 1000),
    b"\xa1\xb2\xc3\xd4": (">", 1000),
    b"\x4d\x3c\xb2\xa1": ("<", 1),
    b"\xa1\xb2\x3c\x4d": (">", 1),
}
PCAPNG = b"\x0a\x0d\x0d\x0a"  # block type of a section header

# tcpdump itself limits a frame to 262,144 octets; a block of pcapng adds options.
MAX_BLOCK = 1 << 20

_SIMPLE_PACKET, _OFFSET = 3, 14
_NOTHING: Mapping[str, object] = MappingProxyType({})


class Frame(NamedTuple):
    """One captured frame. Texts are empty where the file does not contain them.

    number       number in the file, from 1.
    link         LINKTYPE_ value.
    when_ns      Unix time in nanoseconds; None if the frame has no time.
    octets       captured octets.
    missing      number of octets that were not captured.
    interface    name of the interface.
    description  description of the interface.
    direction    received or sent.
    comment      comments of the frame, one per line.
    lost         number of frames of this interface that were not recorded since the previous one.
    said         the station's report of the frame, recorded by `captain record`: keys of topic `frame.` that are not
                 fields here.
    recording    the recorder's description: station, version, configuration.
    """

    number: int
    link: int
    when_ns: int | None
    octets: bytes
    missing: int
    interface: str = ""
    description: str = ""
    direction: Direction = Direction.UNKNOWN
    comment: str = ""
    lost: int = 0
    said: Mapping[str, object] = _NOTHING
    recording: Mapping[str, object] = _NOTHING


def is_capture(head: bytes) -> bool:
    """Whether these first four octets of a file are those of a pcap or pcapng file."""
    return head in PCAP or head == PCAPNG


def frames(head: bytes, stream: BinaryIO) -> Iterator[Frame]:
    """Return the frames of a capture file.

    head    first four octets, which the caller has already read.
    stream  the rest of the file.

    Raises ProtocolError if the file is truncated or inconsistent.
    """
    if head in PCAP:
        return _pcap(*PCAP[head], stream)
    if head == PCAPNG:
        return _pcapng(stream)
    raise ProtocolError(f"{head.hex()}: not the start of a pcap or pcapng file")


def _pcap(order: str, unit_ns: int, stream: BinaryIO) -> Iterator[Frame]:
    header = struct.unpack(order + "HHiIII", _exactly(stream, 20, "its header"))
    link = header[-1] & 0xFFFF  # the upper bits say whether frames end in a checksum
    record = struct.Struct(order + "IIII")
    number = 0
    while head := _next(stream, record.size, number):
        seconds, fraction, captured, original = record.unpack(head)
        number += 1
        if captured > MAX_BLOCK:
            raise ProtocolError(f"frame {number} claims {captured} octets")
        octets = _exactly(stream, captured, f"frame {number}")
        yield Frame(number, link, seconds * 10**9 + fraction * unit_ns, octets, max(0, original - captured))


class _Interface(NamedTuple):
    """Interface of a pcapng section. Its time stamps count units of 1/resolution s, starting at offset_s."""

    link: int
    snap_length: int
    resolution: int
    offset_s: int
    name: str
    description: str
    recording: Mapping[str, object]  # description of the section by its recorder


def _pcapng(stream: BinaryIO) -> Iterator[Frame]:
    (order, recording), interfaces, number = _section(stream), list[_Interface](), 0
    while head := _next(stream, 4, number):
        if head == PCAPNG:
            (order, recording), interfaces = _section(stream), []
            continue
        (kind,) = struct.unpack(order + "I", head)
        block = _block(stream, order, number)
        try:
            if kind == pcapng.INTERFACE:
                interfaces.append(_interface(block, order, recording))
            elif kind == pcapng.ENHANCED_PACKET:
                number += 1
                yield _enhanced(block, order, interfaces, number)
            elif kind == _SIMPLE_PACKET:
                number += 1
                yield _simple(block, order, interfaces, number)
        except (struct.error, IndexError) as error:
            raise ProtocolError(
                f"the block after frame {number} ends too early, or its interface is missing"
            ) from error


def _section(stream: BinaryIO) -> tuple[str, Mapping[str, object]]:
    """Return byte order and recorder's description of a section, whose block type was already read.

    Raises ProtocolError.
    """
    length, magic = _exactly(stream, 4, "a section header"), _exactly(stream, 4, "a section header")
    order = {b"\x1a\x2b\x3c\x4d": ">", b"\x4d\x3c\x2b\x1a": "<"}.get(magic)
    if order is None:
        raise ProtocolError(f"a section has the byte-order magic {magic.hex()}, which is invalid")
    (octets,) = struct.unpack(order + "I", length)
    rest = _exactly(stream, _checked(octets, 0) - 12, "a section header")
    return order, _said(_options(rest[12:-4], order), order)


def _block(stream: BinaryIO, order: str, number: int) -> bytes:
    """Return the body of a block, whose type was already read. Raises ProtocolError if it is truncated."""
    where = f"the block after frame {number}"
    (octets,) = struct.unpack(order + "I", _exactly(stream, 4, where))
    return _exactly(stream, _checked(octets, number) - 8, where)[:-4]


def _checked(octets: int, number: int) -> int:
    """Return the total length of a block. Raises ProtocolError if it is invalid."""
    if not 12 <= octets <= MAX_BLOCK or octets % 4:
        raise ProtocolError(f"the block after frame {number} claims {octets} octets")
    return octets


def _interface(block: bytes, order: str, recording: Mapping[str, object]) -> _Interface:
    link, _, snap_length = struct.unpack_from(order + "HHI", block)
    resolution, offset_s, names = 10**6, 0, {pcapng.IF_NAME: "", pcapng.IF_DESCRIPTION: ""}
    for code, value in _options(block[8:], order):
        if code == pcapng.IF_RESOLUTION and value:
            resolution = 2 ** (value[0] & 0x7F) if value[0] & 0x80 else 10 ** value[0]
        elif code == _OFFSET:
            (offset_s,) = struct.unpack(order + "q", value)
        elif code in names:
            names[code] = _words(value)
    name, description = names.values()
    return _Interface(link, snap_length, resolution, offset_s, name, description, recording)


def _options(octets: bytes, order: str) -> Iterator[tuple[int, bytes]]:
    at = 0
    while at + 4 <= len(octets):
        code, length = struct.unpack_from(order + "HH", octets, at)
        if code == pcapng.END_OF_OPTIONS:
            return
        yield code, octets[at + 4 : at + 4 + length]
        at += 4 + (length + 3) // 4 * 4


def _enhanced(block: bytes, order: str, interfaces: list[_Interface], number: int) -> Frame:
    index, high, low, captured, original = struct.unpack_from(order + "IIIII", block)
    one = interfaces[index]
    octets = block[20 : 20 + captured]
    if len(octets) < captured:
        raise ProtocolError(f"frame {number} claims {captured} octets and has {len(octets)}")
    when_ns = one.offset_s * 10**9 + (high << 32 | low) * 10**9 // one.resolution
    options = list(_options(block[20 + (captured + 3) // 4 * 4 :], order))
    flags, lost = (_number(options, order, *which) for which in ((pcapng.EPB_FLAGS, "I"), (pcapng.EPB_DROPS, "Q")))
    return Frame(
        number,
        one.link,
        when_ns,
        octets,
        max(0, original - captured),
        one.name,
        one.description,
        _DIRECTIONS[flags & 3],
        "\n".join(_words(value) for code, value in options if code == pcapng.COMMENT),
        lost,
        _said(options, order),
        one.recording,
    )


_DIRECTIONS = (Direction.UNKNOWN, Direction.IN, Direction.OUT, Direction.UNKNOWN)


def _number(options: list[tuple[int, bytes]], order: str, code: int, form: str) -> int:
    """Return the number in an option; 0 if the option is missing."""
    for one, value in options:
        if one == code:
            return int(struct.unpack(order + form, value)[0])
    return 0


def _said(options: Iterable[tuple[int, bytes]], order: str) -> Mapping[str, object]:
    """Return the JSON object in this project's custom option.

    Empty if the option is missing, or belongs to another user of the same enterprise number.
    """
    head = struct.pack(order + "I", pcapng.ENTERPRISE) + pcapng.SAID.encode()
    for code, value in options:
        if code == pcapng.CUSTOM_TEXT and value.startswith(head):
            try:
                found = json.loads(value[len(head) :])
            except (ValueError, RecursionError):
                continue
            return found if isinstance(found, dict) else _NOTHING
    return _NOTHING


def _words(value: bytes) -> str:
    return value.decode(errors="replace")


def _simple(block: bytes, order: str, interfaces: list[_Interface], number: int) -> Frame:
    (original,) = struct.unpack_from(order + "I", block)
    one = interfaces[0]
    captured = min(original, one.snap_length or original)
    octets = block[4 : 4 + captured]
    return Frame(
        number, one.link, None, octets, original - captured, one.name, one.description, recording=one.recording
    )


def _next(stream: BinaryIO, size: int, number: int) -> bytes:
    """Return the head of the next record; empty at the end of the file. Raises ProtocolError if it is truncated."""
    octets = _read(stream, size)
    if octets and len(octets) < size:
        raise ProtocolError(f"truncated after frame {number}")
    return octets


def _exactly(stream: BinaryIO, size: int, where: str) -> bytes:
    octets = _read(stream, size)
    if len(octets) < size:
        raise ProtocolError(f"it is cut off in {where}: {len(octets)} of {size} octets")
    return octets


def _read(stream: BinaryIO, size: int) -> bytes:
    """Return `size` octets, fewer at the end of the stream; a pipe may deliver them in several parts."""
    octets = b""
    while len(octets) < size and (more := stream.read(size - len(octets))):
        octets += more
    return octets


# -- writer of classic pcap: time stamps in nanoseconds, link type Ethernet

MAGIC_NS = 0xA1B23C4D
SNAP_LENGTH = 65535
ETHERNET = 1


def header() -> bytes:
    """Return the header of a pcap file of Ethernet frames."""
    return struct.pack("<IHHiIII", MAGIC_NS, 2, 4, 0, 0, SNAP_LENGTH, ETHERNET)


def record(frame: bytes, when_ns: int) -> bytes:
    """Return a record with one Ethernet frame, which begins with the destination address.

    when_ns  Unix time in nanoseconds. Raises RequestError if it is outside the 32-bit seconds of pcap.
    """
    seconds, nanoseconds = divmod(when_ns, 10**9)
    if not 0 <= seconds < 1 << 32:
        raise RequestError(f"a frame is of {seconds} s Unix time: pcap has 0 to {(1 << 32) - 1} s", "take --to json")
    return struct.pack("<IIII", seconds, nanoseconds, len(frame), len(frame)) + frame
