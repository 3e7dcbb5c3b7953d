"""State of a u-blox receiver: jamming, spoofing, antenna, leap seconds, corrections."""

import logging

from board.runtime.journal import Journal
from board.time.scales import GPS_EPOCH
from drivers.wire.gnss.time import Leap, civil_ns, leap_of
from drivers.wire.ublox.health import MonRf, SecSig
from drivers.wire.ublox.messages import CORRECTION_AGE_S, Message, NavPvt, NavStatus, RxmRtcm
from drivers.wire.ublox.time import NavTimeLs

JAMMING = ("unknown", "none", "warning", "critical")
SPOOFING = ("unknown", "none", "indicated", "affirmed")
ANTENNA = ("starting", "unknown", "ok", "short circuit", "open")
POWER = ("off", "on", "unknown")
LEAP_SOURCES = ("firmware", "glonass", "gps", "sbas", "beidou", "galileo")

# A receiver may end the announcement of a leap second before it counts the leap second. This is accepted from EARLY_S
# before the event, because its last epoch may be that old, until LATE_S after it.
EARLY_S, LATE_S = 2, 60

# Normal states: a change to any other state is logged as a warning, a change back at INFO.
_QUIET = ("unknown", "none", "ok", "starting")


class ReceiverState:
    """State of a receiver, from its messages. It logs each deterioration and its end, with a limited rate.

    leap  leap seconds, and an announced leap second; None before the first report.
    pvt   last NAV-PVT message; None before the first.
    """

    def __init__(self, journal: Journal) -> None:
        self.leap: Leap | None = None
        self.pvt: NavPvt | None = None
        self._journal = journal
        self._words: dict[str, str] = {"jamming": "unknown", "spoofing": "unknown", "antenna": "unknown"}
        self._leap_source = "unknown"
        self._has_signal_security = False
        self._used = self._unused = self._damaged = 0

    def take(self, message: Message) -> None:
        """Take over the values of a message; most types of message are ignored."""
        match message:
            case NavPvt():
                self.pvt = message
            case NavTimeLs():
                self._take_leap(message)
            case SecSig():
                self._has_signal_security = True
                self._set("jamming", JAMMING, message.jamming)
                self._set("spoofing", SPOOFING, message.spoofing)
            case NavStatus() if not self._has_signal_security:
                self._set("spoofing", SPOOFING, message.spoofing)
            case MonRf() if message.blocks:
                if not self._has_signal_security:
                    self._set("jamming", JAMMING, max(block.jamming for block in message.blocks))
                self._set("antenna", ANTENNA, max(block.antenna for block in message.blocks))
                self._words["antenna_power"] = _word(POWER, message.blocks[0].power)
            case RxmRtcm():
                self._used += message.use == 2
                self._unused += message.use == 1
                self._damaged += message.is_damaged

    def details(self) -> dict[str, object]:
        """Return the state for status."""
        found: dict[str, object] = {**self._words}
        leap = self.leap
        found["leap_seconds"] = leap.seconds if leap else None
        found["leap_source"] = self._leap_source
        if leap is not None and leap.event is not None:
            found["leap_change"] = {"seconds": leap.change, "unix": GPS_EPOCH + leap.event - leap.seconds}
        if self.pvt is not None:
            found["pdop"] = self.pvt.pdop / 100
            found["utc_resolved"] = self.pvt.is_fully_resolved
        return found

    def corrections(self) -> dict[str, object]:
        """Return the receiver's use of corrections, for status: their age, and numbers of used and unused frames."""
        row = self.pvt.correction_age if self.pvt else 0
        age = CORRECTION_AGE_S[row] if row < len(CORRECTION_AGE_S) else None
        return {
            "age_s_below": age if row else None,
            "is_old": age is None,
            "used": self._used,
            "unused": self._unused,
            "damaged": self._damaged,
        }

    def _take_leap(self, message: NavTimeLs) -> None:
        self._leap_source = _word(LEAP_SOURCES, message.source)
        before, now = self.leap, self._unix_now()
        leap = leap_of(message, now)
        if before is None or before.event is None or leap != Leap(before.seconds):
            self.leap = leap
        # Without a date, the event cannot be located. The earlier event is kept while the receiver still announces it.
        elif now is None:
            self.leap = before if message.is_event_known and message.change == before.change else leap
        # The announcement has ended: the event was withdrawn, or it has just passed and is not counted yet.
        else:
            since_event_s = now - before.unix(before.event - 1) - 1
            self.leap = before if -EARLY_S <= since_event_s <= LATE_S else leap

    def _unix_now(self) -> int | None:
        pvt = self.pvt
        if pvt is None or not (pvt.is_date_valid and pvt.is_time_valid):
            return None
        now_ns = civil_ns(pvt.year, pvt.month, pvt.day, pvt.hour, pvt.minute, pvt.second, 0)
        return None if now_ns is None else now_ns // 10**9

    def _set(self, what: str, words: tuple[str, ...], number: int) -> None:
        before, now = self._words[what], _word(words, number)
        self._words[what] = now
        if now == before or (now in _QUIET and before in _QUIET):
            return
        level = logging.INFO if now in _QUIET else logging.WARNING
        self._journal.say(level, f"{what}: {now}, was {before}", about=f"{what} {now}")


def _word(words: tuple[str, ...], number: int) -> str:
    return words[number] if number < len(words) else "unknown"
