"""Counter of garbage: octets outside of frames. Reports each run once, with its first octets."""

from typing import NamedTuple

from drivers.reason import Reason

SAMPLE = 64  # first octets of a run that are kept for the report


class Garbage(NamedTuple):
    """Run of octets that belong to no valid frame.

    reason  FRAMING for octets between two frames, CHECKSUM for a damaged frame.
    sample  first octets of the run, at most SAMPLE.
    octets  length of the whole run.
    """

    reason: Reason
    sample: bytes
    octets: int


class Passed:
    """Counter of octets that were skipped since the last report.

    octets  number of skipped octets.
    reason  FRAMING, unless the parser sets a more specific one.
    """

    def __init__(self) -> None:
        self.reason, self._sample, self.octets = Reason.FRAMING, b"", 0

    def add(self, buffer: bytearray, start: int, end: int) -> None:
        """Count the octets buffer[start:end] as skipped."""
        room = SAMPLE - len(self._sample)
        if room > 0:
            self._sample += buffer[start : min(end, start + room)]
        self.octets += end - start

    def take(self) -> list[Garbage]:
        """Return the skipped octets as one Garbage, or an empty list without any; reset the counter."""
        told = [Garbage(self.reason, bytes(self._sample), self.octets)] if self.octets else []
        self.reason, self._sample, self.octets = Reason.FRAMING, b"", 0
        return told
