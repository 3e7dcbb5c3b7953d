"""Stream of a GNSS receiver: splits octets into UBX, NMEA and RTCM 3 frames.

Each kind of frame has its own start octets, a length and a checksum. If length or checksum are wrong, the search
continues one octet after the start of the frame, in the octets already received. So a damaged frame or a false start
loses no other frame.
"""

import re
from typing import Final

from drivers.reason import Reason
from drivers.wire import rtcm
from drivers.wire.garbage import Garbage, Passed
from drivers.wire.gnss import nmea
from drivers.wire.ublox import ubx

Event = ubx.UbxFrame | nmea.Sentence | rtcm.RtcmFrame | Garbage

# A frame must be complete within this time. The longest requested message, a MON-VER of 340 octets, takes 0.4 s at
# 9,600 baud. A false start may announce 8,200 octets.
FRAME_S = 1.0

MAX_GARBAGE = 1024  # octets of one Garbage event, at least

# Limit of the computing time for wrong checksums. An attacker could send a false start every six octets, each with a
# length of 8,000; checking them would take seconds per second of input. Each received octet adds CREDIT octets for
# wrong checksums, up to MOST_CREDIT. Without credit, a wrong frame is skipped as a whole. A noisy line stays far below
# the limit.
CREDIT, MOST_CREDIT = 8, 65_536

_BEGINNING = re.compile(rb"[\xb5$\xd3]")
# The body of a sentence has printable characters without `$` and `*`. _SENTENCE_BEGUN matches an incomplete sentence.
# The standard requires capital hexadecimal digits and CR LF. Some receivers send small digits. Loggers and ttys remove
# or double the CR.
_SENTENCE = re.compile(rb"\$([ -#%-)+-~]{5,256})\*([0-9A-Fa-f]{2})\r{0,2}\n")
_SENTENCE_BEGUN = re.compile(rb"\$[ -#%-)+-~]{0,256}(\*([0-9A-Fa-f]{0,2}|[0-9A-Fa-f]{2}\r{1,2}))?")


# Result of parsing at an index, and the end: a frame, the reason why it is invalid, or _MORE for an incomplete frame.
_Found = tuple[ubx.UbxFrame | nmea.Sentence | rtcm.RtcmFrame | Reason | None, int]
_MORE: Final = (None, 0)


class GnssStream:
    """Parser of a receiver's stream; how the stream is split into reads does not change the frames.

    Every octet belongs to a frame or is counted as garbage. A run of garbage is one event: before the next frame, or
    when the run reaches MAX_GARBAGE.
    """

    def __init__(self) -> None:
        self._waiting = bytearray()
        self._since: float | None = None  # time when the incomplete frame began
        self._credit = MOST_CREDIT
        self._passed = Passed()

    def receive(self, octets: bytes, now: float) -> list[Event]:
        """Return the frames and sentences that the octets complete, and the garbage before them."""
        events: list[Event] = []
        self._waiting += octets
        self._credit = min(MOST_CREDIT, self._credit + CREDIT * len(octets))
        self._scan(events, now)
        if self._passed.octets >= MAX_GARBAGE:
            events += self._passed.take()
        return events

    def deadline(self) -> float | None:
        """Return the time when expire() must be called; None without an incomplete frame."""
        return None if self._since is None else self._since + FRAME_S

    def expire(self, now: float) -> list[Event]:
        """Discard a frame that is still incomplete after FRAME_S; search the octets after its start again."""
        events: list[Event] = []
        deadline = self.deadline()
        if deadline is not None and now >= deadline:
            self._skip(1)
            self._scan(events, now)
            if not self._waiting:
                events += self._passed.take()
        return events

    def _scan(self, events: list[Event], now: float) -> None:
        """Take all complete frames from the buffer; an incomplete frame remains."""
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
        """Count an invalid frame; return the index where the search continues."""
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
    return ubx.UbxFrame(body[0] << 8 | body[1], body[4:]), end


def _rtcm(waiting: bytearray, at: int) -> _Found:
    if len(waiting) > at + 1 and waiting[at + 1] > 3:  # six zero bits precede the length
        return Reason.FRAMING, at + 1
    if len(waiting) < at + 3:
        return _MORE
    end = at + int.from_bytes(waiting[at + 1 : at + 3]) + rtcm.OVERHEAD
    if len(waiting) < end:
        return _MORE
    frame = bytes(waiting[at:end])
    return (Reason.CHECKSUM if rtcm.crc24q(frame) else rtcm.RtcmFrame(frame)), end


def _nmea(waiting: bytearray, at: int) -> _Found:
    found = _SENTENCE.match(waiting, at)
    if found is None:
        return _MORE if _SENTENCE_BEGUN.fullmatch(waiting, at) else (Reason.FRAMING, at + 1)
    body, digits = found.groups()
    if nmea.checksum(body) != int(digits, 16):
        return Reason.CHECKSUM, found.end()
    return nmea.Sentence(body.decode("ascii")), found.end()
