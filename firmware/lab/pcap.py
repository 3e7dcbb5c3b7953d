"""Ethernet frames to a file that tshark and Wireshark read."""

from pathlib import Path

from firmware.codec import capture


class Pcap:
    """A capture file; directories that are missing are made."""

    def __init__(self, path: Path) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self.frames = 0
        self._file = path.open("wb")
        self._file.write(capture.header())

    def write(self, frame: bytes, when_ns: int) -> None:
        """Add one frame, destination address first; when_ns is Unix time."""
        self._file.write(capture.record(frame, when_ns))
        self.frames += 1

    def close(self) -> None:
        self._file.close()
