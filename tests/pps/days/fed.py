"""Samples for chronyd of each second, beside the clock to correct."""

import logging
import struct

from board.runtime.journal import Journal
from pps.chrony.feed import Fate, Refclock
from pps.pulse import Clocks
from pps.timemark import Second


class Fed(Refclock):
    """A feed that ends here. offset_ns: of the last sample; None: none was sent."""

    def __init__(self) -> None:
        super().__init__("/run/chrony.day.sock", Journal(logging.getLogger("day"), "chrony", lambda: 0.0))
        self.offset_ns: int | None = None
        self.close()

    def second(self, second: Second, unix_ns: int, now: Clocks) -> int | None:
        """Tell it of a second; returns the offset that was sent."""
        self.offset_ns = None
        self.sample(second.pulse, second.its_s, unix_ns, second.leap_event, now)
        return self.offset_ns

    def _send(self, octets: bytes) -> Fate:
        self.offset_ns = round(struct.unpack("@qqdiiii", octets)[2] * 1e9)
        return Fate.SENT
