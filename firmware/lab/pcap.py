"""Ethernet frames to a file that tshark and Wireshark read."""

import struct
from pathlib import Path
from typing import Final

# Classic pcap (draft-ietf-opsawg-pcap), nanoseconds, link type 1: Ethernet.
MAGIC_NS = 0xA1B23C4D
SNAP_LENGTH = 65535
ETHERNET = 1
FILE_HEADER: Final = struct.Struct("<IHHiIII")
FRAME_HEADER: Final = struct.Struct("<IIII")


class Pcap:
    """A capture file; directories that are missing are made."""

    def __init__(self, path: Path) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self.frames = 0
        self._file = path.open("wb")
        self._file.write(FILE_HEADER.pack(MAGIC_NS, 2, 4, 0, 0, SNAP_LENGTH, ETHERNET))

    def write(self, frame: bytes, when_ns: int) -> None:
        """Add one frame, destination address first; when_ns is Unix time."""
        seconds, nanoseconds = divmod(when_ns, 1_000_000_000)
        self._file.write(FRAME_HEADER.pack(seconds, nanoseconds, len(frame), len(frame)) + frame)
        self.frames += 1

    def close(self) -> None:
        self._file.close()
