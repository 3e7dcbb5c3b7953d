"""What comes out of a GNSS receiver: UBX frames, NMEA sentences and RTCM 3 frames on one line, in any order.

Each begins with octets of its own, and has a length and a checksum. Where they disagree, the search goes on one octet
behind the beginning, in what was received already: a frame that was damaged, or a beginning that was none, takes
nothing with it.
"""

import re
from typing import Final

from drivers.reason import Reason
from drivers.wire import nmea, rtcm, ubx
from drivers.wire.garbage import Garbage, Passed

Event = ubx.Frame | nmea.Sentence | rtcm.Frame | Garbage

# What has begun is complete so soon, or was none. The longest that a receiver is asked for, a MON-VER of 340 octets,
# takes 0.4 s at 9,600 baud; a false beginning may promise 8,200.
FRAME_S = 1.0

MAX_GARBAGE = 1024  # octets that are told in one piece

# What checksums of nothing may cost: beginnings that a peer makes up every six octets, each promising 8,000, would take
# seconds for a second's octets. So many octets of checksums in vain are for each that comes, and as many at once;
# where that is used up, a candidate is passed over whole. A line that is merely bad stays far below.
CREDIT, MOST_CREDIT = 8, 65_536

_BEGINNING = re.compile(rb"[\xb5$\xd3]")
# A sentence is printable but for `$`, `*`, and the end of the line; what is cut off may go on so. The standard has
# capital digits and CR LF. Receivers also send small digits; loggers and ttys take the CR away, or double it.
_SENTENCE = re.compile(rb"\$([ -#%-)+-~]{5,256})\*([0-9A-Fa-f]{2})\r{0,2}\n")
_SENTENCE_BEGUN = re.compile(rb"\$[ -#%-)+-~]{0,256}(\*([0-9A-Fa-f]{0,2}|[0-9A-Fa-f]{2}\r{1,2}))?")


# What begins somewhere and where it ends; why it is none; or nothing yet: more octets are needed.
_Found = tuple[ubx.Frame | nmea.Sentence | rtcm.Frame | Reason | None, int]
_MORE: Final = (None, 0)


class GnssStream:
    """Octets in, frames and sentences out; they do not depend on how the octets were cut.

    Every octet is in one of them or counted as garbage. Garbage is told in one piece before what follows it, and when
    it gets long.
    """

    def __init__(self) -> None:
        self._waiting = bytearray()
        self._since: float | None = None  # when the candidate began
        self._credit = MOST_CREDIT
        self._passed = Passed()

    def receive(self, octets: bytes, now: float) -> list[Event]:
        """What octets complete, and the garbage in front of it."""
        events: list[Event] = []
        self._waiting += octets
        self._credit = min(MOST_CREDIT, self._credit + CREDIT * len(octets))
        self._scan(events, now)
        if self._passed.octets >= MAX_GARBAGE:
            events += self._passed.take()
        return events

    def deadline(self) -> float | None:
        """When expire() wants to be called."""
        return None if self._since is None else self._since + FRAME_S

    def expire(self, now: float) -> list[Event]:
        """Take an unfinished frame for none after its time; what stands behind its beginning is looked at again."""
        events: list[Event] = []
        deadline = self.deadline()
        if deadline is not None and now >= deadline:
            self._skip(1)
            self._scan(events, now)
            if not self._waiting:
                events += self._passed.take()
        return events

    def _scan(self, events: list[Event], now: float) -> None:
        """Take all that is complete from the front; what remains is a candidate."""
        waiting = self._waiting
        at = 0
        while (found := _BEGINNING.search(waiting, at)) is not None:
            self._passed.add(waiting, at, found.start())
            at = found.start()
            result, end = _look(waiting, at)
            if result is None:
                break
            if isinstance(result, Reason):
                at = self._wrong(result, at, end)
                continue
            events += self._passed.take()
            events.append(result)
            at = end
        else:
            self._passed.add(waiting, at, len(waiting))
            at = len(waiting)
        del waiting[:at]
        if not waiting:
            self._since = None
        elif self._since is None or at:
            self._since = now

    def _wrong(self, reason: Reason, at: int, end: int) -> int:
        """Where the search goes on behind a candidate that was none."""
        if reason is Reason.CHECKSUM:
            self._passed.reason = reason
            self._credit -= end - at
        behind = at + 1
        if self._credit < 0:
            self._credit, behind = 0, end
        self._passed.add(self._waiting, at, behind)
        return behind

    def _skip(self, octets: int) -> None:
        self._passed.add(self._waiting, 0, octets)
        del self._waiting[:octets]
        self._since = None


def _look(waiting: bytearray, at: int) -> _Found:
    match waiting[at]:
        case 0xB5:
            return _ubx(waiting, at)
        case 0xD3:
            return _rtcm(waiting, at)
        case _:
            return _nmea(waiting, at)


def _ubx(waiting: bytearray, at: int) -> _Found:
    if not ubx.SYNC.startswith(waiting[at : at + 2]):
        return Reason.FRAMING, at + 1
    if len(waiting) < at + 6:
        return _MORE
    length = waiting[at + 4] | waiting[at + 5] << 8
    end = at + length + ubx.OVERHEAD
    if length > ubx.MAX_PAYLOAD:
        return Reason.FRAMING, at + 1
    if len(waiting) < end:
        return _MORE
    body = bytes(waiting[at + 2 : end - 2])
    if ubx.checksum(body) != waiting[end - 2 : end]:
        return Reason.CHECKSUM, end
    return ubx.Frame(body[0] << 8 | body[1], body[4:]), end


def _rtcm(waiting: bytearray, at: int) -> _Found:
    if len(waiting) > at + 1 and waiting[at + 1] > 3:  # the upper six bits are zero
        return Reason.FRAMING, at + 1
    if len(waiting) < at + 3:
        return _MORE
    end = at + int.from_bytes(waiting[at + 1 : at + 3]) + rtcm.OVERHEAD
    if len(waiting) < end:
        return _MORE
    frame = bytes(waiting[at:end])
    return (Reason.CHECKSUM if rtcm.crc24q(frame) else rtcm.Frame(frame)), end


def _nmea(waiting: bytearray, at: int) -> _Found:
    found = _SENTENCE.match(waiting, at)
    if found is None:
        return _MORE if _SENTENCE_BEGUN.fullmatch(waiting, at) else (Reason.FRAMING, at + 1)
    body, digits = found.groups()
    if nmea.checksum(body) != int(digits, 16):
        return Reason.CHECKSUM, found.end()
    return nmea.Sentence(body.decode("ascii")), found.end()
