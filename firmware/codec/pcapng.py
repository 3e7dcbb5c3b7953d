"""pcapng, the form of capture that says of each frame by which interface it went, which way, and what is known of it.

Source: draft-ietf-opsawg-pcapng. Numbers of blocks and options are those of its tables. `capture` reads it.
"""

import json
import struct
from collections.abc import Mapping
from enum import IntEnum
from typing import Protocol

MAGIC = 0x1A2B3C4D  # written in the order of this program: little-endian
SECTION, INTERFACE, STATISTICS, ENHANCED_PACKET = 0x0A0D0D0A, 1, 5, 6
END_OF_OPTIONS, COMMENT = 0, 1
SECTION_HARDWARE, SECTION_OS, SECTION_APPLICATION = 2, 3, 4
IF_NAME, IF_DESCRIPTION, IF_RESOLUTION = 2, 3, 9
EPB_FLAGS, EPB_DROPS = 2, 4
ISB_RECEIVED, ISB_DROPPED = 4, 5

# A custom option of text that may be copied, and whose it is: 32473 is the enterprise of documentation (RFC 5612), for
# this project has no number of its own. What follows is therefore looked at before it is believed: SAID begins it.
CUSTOM_TEXT = 2988
ENTERPRISE = 32473
SAID = "captain:"

ETHERNET = 1  # LINKTYPE_
SNAP_LENGTH = 65535
NANOSECONDS = b"\x09"  # 10^-9 s
LONGEST_TEXT = 8192  # octets of an option; its length has 16 bits


class Direction(IntEnum):
    """The low bits of epb_flags."""

    UNKNOWN = 0
    IN = 1
    OUT = 2


class Stream(Protocol):
    def write(self, octets: bytes, /) -> object: ...


class Pcapng:
    """A recording into a stream; it is whole after each block, so that no end need be written.

    application  that writes it, with its version.
    comment      of the whole, in words: `capinfos` and Wireshark's properties of a capture show it.
    said         of the whole, for programs.
    size         octets written.
    """

    def __init__(
        self, stream: Stream, application: str, comment: str = "", said: Mapping[str, object] | None = None
    ) -> None:
        self._stream = stream
        self._interfaces: dict[str, int] = {}
        self.size = 0
        head = struct.pack("<IHHq", MAGIC, 1, 0, -1)  # the section's length is not known
        options = (SECTION_APPLICATION, _text(application)), (COMMENT, _text(comment)), (CUSTOM_TEXT, _custom(said))
        self._put(SECTION, head + _options(*options))

    def interface(self, name: str, description: str = "") -> int:
        """Number of an interface, which is described before its first frame; once for each name."""
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
        """One Ethernet frame, destination address first.

        when_ns  Unix time; one before 1970 is written as 1970.
        said     what programs are told of it: JSON in the custom option.
        lost     frames of this interface between the one before and this that nobody recorded.
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
        """What an interface had until now: frames that were recorded, and those that were lost on the way here."""
        number, when = self.interface(interface), max(0, when_ns)
        head = struct.pack("<III", number, when >> 32, when & 0xFFFFFFFF)
        counts = (ISB_RECEIVED, struct.pack("<Q", received)), (ISB_DROPPED, struct.pack("<Q", dropped))
        self._put(STATISTICS, head + _options((COMMENT, _text(comment)), *counts))

    def _put(self, kind: int, body: bytes) -> None:
        length = len(body) + 12
        self._stream.write(struct.pack("<II", kind, length) + body + struct.pack("<I", length))
        self.size += length


def _options(*options: tuple[int, bytes]) -> bytes:
    """Those that hold something, and their end."""
    whole = b"".join(struct.pack("<HH", code, len(value)) + _padded(value) for code, value in options if value)
    return whole + struct.pack("<HH", END_OF_OPTIONS, 0) if whole else b""


def _text(text: str) -> bytes:
    return text.encode(errors="replace")[:LONGEST_TEXT].decode(errors="ignore").encode()


def _custom(said: Mapping[str, object] | None) -> bytes:
    """An object that is too long is left out: a part of it is none."""
    octets = (SAID + json.dumps(said, separators=(",", ":"))).encode() if said else b""
    return struct.pack("<I", ENTERPRISE) + octets if 0 < len(octets) <= LONGEST_TEXT else b""


def _padded(octets: bytes) -> bytes:
    return octets + bytes(-len(octets) % 4)
