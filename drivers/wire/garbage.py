"""What on a line is in no frame: counted as it is passed over, and told in one piece with how it began."""

from typing import NamedTuple

from drivers.reason import Reason

SAMPLE = 64  # octets of it that are kept to be shown


class Garbage(NamedTuple):
    """Octets that are no frame: FRAMING between two frames, CHECKSUM where one was damaged.

    sample  begins as they did. octets counts them all.
    """

    reason: Reason
    sample: bytes
    octets: int


class Passed:
    """Octets that were passed over since the last time that they were told.

    octets  so many. reason: why; whoever finds a better one than FRAMING sets it.
    """

    def __init__(self) -> None:
        self._begin()

    def add(self, buffer: bytearray, start: int, end: int) -> None:
        """Pass over a stretch of a buffer."""
        room = SAMPLE - len(self._sample)
        if room > 0:
            self._sample += buffer[start : min(end, start + room)]
        self.octets += end - start

    def take(self) -> list[Garbage]:
        """What was passed over, where anything was; counting begins anew."""
        told = [Garbage(self.reason, bytes(self._sample), self.octets)] if self.octets else []
        self._begin()
        return told

    def _begin(self) -> None:
        self.reason, self._sample, self.octets = Reason.FRAMING, b"", 0
