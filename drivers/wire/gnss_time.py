"""Time as satellites have it: weeks and seconds of GPS, leap seconds, and what a receiver's messages make of them.

GPS time counts all seconds since 1980-01-06T00:00:00Z; Unix time leaves leap seconds out, and repeats the second
before one. ITS time, too, counts all seconds (board/time.py). Source: IS-GPS-200N, clause 20.3.3.5.2.4.
"""

import calendar
from typing import NamedTuple

from board.time import GPS_EPOCH, GPS_LEAD, LeapEvent
from drivers.wire.ubx_messages import NavPvt
from drivers.wire.ubx_time import NavTimeLs, TimTp

WEEK = 604_800  # s
DAY = 86_400  # s
MOST_LEAPS = 127  # NAV-TIMELS has an octet for them, with a sign

# A satellite says its week in ten bits; the rest is the firmware's guess, which is 1024 weeks too early once the
# firmware is that old. No receiver that we talk to was made before 2016: what it says of earlier years is that.
EARLIEST = 1_451_606_400  # 2016-01-01T00:00:00Z
ROLLOVER = 1024 * WEEK

GPS, GALILEO = 0, 3  # TIM-TP.timeRefGnss; their seconds are the same but for some ns


class Leap(NamedTuple):
    """GPS time less UTC, s, and the next change of it.

    event   GPS time of the first second that the change has to do with: 23:59:60 where one is inserted, the one that
            would have been 23:59:59 where one is left out; None: none is announced.
    change  1, or -1.
    """

    seconds: int
    event: int | None = None
    change: int = 0

    def unix(self, gps: int) -> int:
        """Unix time of a second of GPS time since its epoch."""
        seconds = self.seconds
        if self.event is not None and gps >= self.event:
            seconds += self.change
        return GPS_EPOCH + gps - seconds

    @property
    def announced(self) -> LeapEvent | None:
        """The event in ITS time."""
        return None if self.event is None else LeapEvent(self.event - GPS_LEAD, self.change)


def leap_of(message: NavTimeLs, unix_now: int | None) -> Leap | None:
    """Leap seconds of a NAV-TIMELS; None while they are the firmware's default.

    unix_now  of about the same moment; None: an announced change cannot be placed.
    """
    if not message.is_known:
        return None
    leap = Leap(message.leap_seconds)
    if unix_now is None or not message.is_event_known or message.to_event_s < 0 or message.change == 0:
        return leap
    # It is at the end of a day in UTC. The countdown says of which, whatever second of it firmware counts to, and
    # however the message numbers days: BeiDou's begin with another one than those of GPS.
    midnight = round((unix_now - GPS_EPOCH + message.to_event_s) / DAY) * DAY
    return Leap(leap.seconds, midnight + leap.seconds - (message.change < 0), message.change)


def counted(pvt: NavPvt) -> int | None:
    """Leap seconds as the receiver counts them at an epoch, be they its firmware's guess: it says one and the same
    moment as GPS time of week and as time of day. None where these are not of one moment.
    """
    of_day_s = pvt.hour * 3600 + pvt.minute * 60 + pvt.second
    seconds = round((pvt.itow_ms * 10**6 - pvt.nano) / 10**9 - of_day_s) % DAY
    return seconds if pvt.is_date_valid and pvt.is_time_valid and seconds <= MOST_LEAPS else None


def resolved(unix: int) -> int:
    """A moment in Unix time with the 1024 weeks put back that old firmware leaves out."""
    while unix < EARLIEST:
        unix += ROLLOVER
    return unix


def utc_ns(pvt: NavPvt) -> int | None:
    """Unix time of an epoch in ns; None until date, time and leap seconds are beyond doubt."""
    if not (pvt.is_date_valid and pvt.is_time_valid and pvt.is_fully_resolved and pvt.is_confirmed):
        return None
    return civil_ns(pvt.year, pvt.month, pvt.day, pvt.hour, pvt.minute, pvt.second, pvt.nano)


def civil_ns(year: int, month: int, day: int, hour: int, minute: int, second: int, nano: int) -> int | None:
    """Unix time in ns of a date and a time of day; None where there is none.

    second  60 in a leap second, which repeats the one before.
    nano    may be negative: the moment is in the second before.
    """
    is_date = 1980 <= year <= 2400 and 1 <= month <= 12 and 1 <= day <= calendar.monthrange(year, month)[1]
    if not (is_date and hour < 24 and minute < 60 and second <= 60):
        return None
    is_repeated = second == 60 and nano >= 0
    unix = calendar.timegm((year, month, day, hour, minute, second - is_repeated))
    return resolved(unix) * 10**9 + nano


class Pulse(NamedTuple):
    """Which second a pulse begins: GPS time since its epoch, and Unix time. None where it is not known."""

    gps: int | None
    unix: int | None


class Pulses:
    """Finds the second of each TIM-TP; TIM-TP speaks of the pulse that comes next.

    Where it counts UTC, a leap second and the second behind it have one number, and firmware is free to give the
    leap second that of the second before. There alone the seconds that went by since the last pulse decide; without
    such a pulse the second is not known, for a second that is wrong is worse than none.

    epoch_s  between two messages; the same pulse may be announced several times.
    """

    def __init__(self, epoch_s: float) -> None:
        self._slack = epoch_s / 2
        self._last: tuple[int, float] | None = None  # GPS time of a pulse, and when it was first announced

    def pulse(self, message: TimTp, leap: Leap | None, now: float, guess: int | None = None) -> Pulse:
        """The second of an announced pulse.

        now    in seconds of a monotonic clock.
        guess  leap seconds as the receiver counts them while they are not known: enough for GPS time of its UTC.
        """
        # An announced event stands in weeks that were put back, so the count has to as well.
        count = resolved(GPS_EPOCH + message.week * WEEK + round(message.tow_ms / 1000)) - GPS_EPOCH
        if not message.is_utc:
            # GLONASS and BeiDou count from elsewhere; no receiver is configured to follow them.
            gps = count if message.system in (GPS, GALILEO) else None
        elif leap is not None:
            gps = self._of_utc(count, leap, now)
        else:
            gps = self._of_guess(count, guess, now)
        if gps is None:
            self._last = None
            return Pulse(None, None)
        if self._last is None or self._last[0] != gps:
            self._last = (gps, now)
        return Pulse(gps, leap.unix(gps) if leap is not None else None)

    def _of_utc(self, count: int, leap: Leap, now: float) -> int | None:
        before, after = count + leap.seconds, count + leap.seconds + leap.change
        if leap.event is None or before < leap.event - 2:
            return before
        if before > leap.event + 2:
            return after
        expected = self._expected(now)
        return expected if expected in (before, after) else None

    def _of_guess(self, count: int, guess: int | None, now: float) -> int | None:
        """A guess is followed by another one, or by what satellites say, at any moment: then pulses do not go on."""
        if guess is None:
            return None
        return count + guess if self._expected(now) in (None, count + guess) else None

    def _expected(self, now: float) -> int | None:
        return None if self._last is None else self._last[0] + int(now - self._last[1] + self._slack)
