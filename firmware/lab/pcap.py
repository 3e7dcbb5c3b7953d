"""Writer of Ethernet frames to a file for tshark and Wireshark."""

from pathlib import Path

from firmware.recordings import capture


class Pcap:
    """Capture file; missing folders are created."""

    def __init__(self, path: Path) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self.frames = 0
        self._file = path.open("wb")
        self._file.write(capture.header())

    def write(self, frame: bytes, when_ns: int) -> None:
        """Add one frame, which begins with the destination address; when_ns: Unix time in nanoseconds."""
        self._file.write(capture.record(frame, when_ns))
        self.frames += 1

    def close(self) -> None:
        self._file.close()
