"""Writer of pcapng: frames with interface, direction, comment and custom option.

Source: draft-ietf-opsawg-pcapng, with its tables of blocks and options. The module `capture` reads these files.
"""

import json
import struct
from collections.abc import Mapping
from enum import IntEnum
from typing import Protocol

MAGIC = 0x1A2B3C4D  # byte-order magic; written little-endian
SECTION, INTERFACE, STATISTICS, ENHANCED_PACKET = 0x0A0D0D0A, 1, 5, 6
END_OF_OPTIONS, COMMENT = 0, 1
SECTION_APPLICATION = 4
IF_NAME, IF_DESCRIPTION, IF_RESOLUTION = 2, 3, 9
EPB_FLAGS, EPB_DROPS = 2, 4
ISB_RECEIVED, ISB_DROPPED = 4, 5

# Code of a custom option with text that other programs may copy, and its enterprise number. This project has no number
# of its own, so it uses 32473, which RFC 5612 reserves for documentation. Others may use it too; only an option whose
# text begins with SAID is ours.
CUSTOM_TEXT = 2988
ENTERPRISE = 32473
SAID = "captain:"

ETHERNET = 1  # LINKTYPE_
SNAP_LENGTH = 65535
NANOSECONDS = b"\x09"  # 10^-9 s
LONGEST_TEXT = 8192  # octets of an option's text; the format has 16 bits for its length


class Direction(IntEnum):
    """Direction of a frame: the low bits of epb_flags."""

    UNKNOWN = 0
    IN = 1
    OUT = 2


class Stream(Protocol):
    def write(self, octets: bytes, /) -> object: ...


class Pcapng:
    """Writer of a recording to a stream. The file is valid after each block, so it needs no end.

    application  name and version of the writing program.
    comment      text about the recording, which `capinfos` and Wireshark show.
    said         the same for programs, written as JSON.
    size         octets written.
    """

    def __init__(
        self, stream: Stream, application: str, comment: str = "", said: Mapping[str, object] | None = None
    ) -> None:
        self._stream = stream
        self._interfaces: dict[str, int] = {}
        self.size = 0
        head = struct.pack("<IHHq", MAGIC, 1, 0, -1)  # -1: the length of the section is unknown
        options = (SECTION_APPLICATION, _text(application)), (COMMENT, _text(comment)), (CUSTOM_TEXT, _custom(said))
        self._put(SECTION, head + _options(*options))

    def interface(self, name: str, description: str = "") -> int:
        """Describe an interface before its first frame, once for each name, and return its number."""
        if name not in self._interfaces:
            head = struct.pack("<HHI", ETHERNET, 0, SNAP_LENGTH)
            options = (IF_NAME, _text(name)), (IF_DESCRIPTION, _text(description)), (IF_RESOLUTION, NANOSECONDS)
            self._put(INTERFACE, head + _options(*options))
            self._interfaces[name] = len(self._interfaces)
        return self._interfaces[name]

    def add(
        self,
        interface: str,
        when_ns: int,
        frame: bytes,
        direction: Direction = Direction.UNKNOWN,
        comment: str = "",
        said: Mapping[str, object] | None = None,
        lost: int = 0,
    ) -> None:
        """Add one Ethernet frame, which begins with the destination address.

        when_ns  Unix time in nanoseconds; a time before 1970 is written as 1970.
        comment  text for people.
        said     object for programs, written as JSON to the custom option.
        lost     number of frames of this interface that were not recorded since the previous one.
        """
        number = self.interface(interface)
        stored = frame[:SNAP_LENGTH]
        when = max(0, when_ns) & 0xFFFFFFFF_FFFFFFFF
        head = struct.pack("<IIIII", number, when >> 32, when & 0xFFFFFFFF, len(stored), len(frame))
        options = _options(
            (COMMENT, _text(comment)),
            (EPB_FLAGS, struct.pack("<I", direction)),
            (EPB_DROPS, struct.pack("<Q", lost) if lost else b""),
            (CUSTOM_TEXT, _custom(said)),
        )
        self._put(ENHANCED_PACKET, head + _padded(stored) + options)

    def statistics(self, interface: str, when_ns: int, received: int, dropped: int, comment: str = "") -> None:
        """Write the statistics of an interface: frames recorded, and frames lost before the recorder."""
        number, when = self.interface(interface), max(0, when_ns)
        head = struct.pack("<III", number, when >> 32, when & 0xFFFFFFFF)
        counts = (ISB_RECEIVED, struct.pack("<Q", received)), (ISB_DROPPED, struct.pack("<Q", dropped))
        self._put(STATISTICS, head + _options((COMMENT, _text(comment)), *counts))

    def _put(self, kind: int, body: bytes) -> None:
        length = len(body) + 12
        self._stream.write(struct.pack("<II", kind, length) + body + struct.pack("<I", length))
        self.size += length


def _options(*options: tuple[int, bytes]) -> bytes:
    """Return the nonempty options, followed by the end of options."""
    whole = b"".join(struct.pack("<HH", code, len(value)) + _padded(value) for code, value in options if value)
    return whole + struct.pack("<HH", END_OF_OPTIONS, 0) if whole else b""


def _text(text: str) -> bytes:
    return text.encode(errors="replace")[:LONGEST_TEXT].decode(errors="ignore").encode()


def _custom(said: Mapping[str, object] | None) -> bytes:
    """Return the custom option with an object as JSON; empty if it is too long, since truncated JSON is invalid."""
    octets = (SAID + json.dumps(said, separators=(",", ":"))).encode() if said else b""
    return struct.pack("<I", ENTERPRISE) + octets if 0 < len(octets) <= LONGEST_TEXT else b""


def _padded(octets: bytes) -> bytes:
    return octets + bytes(-len(octets) % 4)
