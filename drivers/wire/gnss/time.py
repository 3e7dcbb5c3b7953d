"""GNSS time: converts GPS weeks and seconds, leap seconds and a receiver's messages to Unix time.

GPS time counts all seconds since 1980-01-06T00:00:00Z. Unix time does not count leap seconds: in a leap second it
repeats the second before. ITS time counts all seconds, like GPS time (board/time/scales.py).
Source: IS-GPS-200N, clause 20.3.3.5.2.4.
"""

import calendar
from typing import NamedTuple

from board.time.scales import GPS_EPOCH, GPS_LEAD, LeapEvent
from drivers.wire.ublox.messages import NavPvt
from drivers.wire.ublox.time import NavTimeLs, TimTp

WEEK = 604_800  # s
DAY = 86_400  # s
MOST_LEAPS = 127  # NAV-TIMELS has a signed octet for leap seconds

# A satellite sends its week in ten bits; the firmware assumes the rest. Old firmware assumes a date that is 1024 weeks
# too early. All supported receivers were made after 2015, so an earlier date must be such an error.
EARLIEST = 1_451_606_400  # 2016-01-01T00:00:00Z
ROLLOVER = 1024 * WEEK

GPS, GALILEO = 0, 3  # values of TIM-TP.timeRefGnss; the two time scales differ only by some ns


class Leap(NamedTuple):
    """Difference of GPS time and UTC in seconds, and its next change.

    event   GPS time of the first second that the change affects; None: no change is announced. This is 23:59:60 for an
            inserted second, and the second that would be 23:59:59 for a removed one.
    change  1 for an inserted second, -1 for a removed one.
    """

    seconds: int
    event: int | None = None
    change: int = 0

    def unix(self, gps: int) -> int:
        """Return the Unix time of a second of GPS time, given since the GPS epoch."""
        seconds = self.seconds
        if self.event is not None and gps >= self.event:
            seconds += self.change
        return GPS_EPOCH + gps - seconds

    @property
    def announced(self) -> LeapEvent | None:
        """Announced leap second with its ITS time; None without one."""
        return None if self.event is None else LeapEvent(self.event - GPS_LEAD, self.change)


def leap_of(message: NavTimeLs, unix_now: int | None) -> Leap | None:
    """Return the leap seconds of a NAV-TIMELS; None while they are the firmware's default.

    unix_now  Unix time of about the same moment; None: an announced change is ignored, because it has no date.
    """
    if not message.is_known:
        return None
    leap = Leap(message.leap_seconds)
    if unix_now is None or not message.is_event_known or message.to_event_s < 0 or message.change == 0:
        return leap
    # The event is at the end of a UTC day. The countdown determines the day, also if firmware counts to another second
    # of it. The day number of the message is not used: BeiDou numbers days differently from GPS.
    midnight = round((unix_now - GPS_EPOCH + message.to_event_s) / DAY) * DAY
    return Leap(leap.seconds, midnight + leap.seconds - (message.change < 0), message.change)


def counted(pvt: NavPvt) -> int | None:
    """Return the leap seconds that the receiver uses at an epoch, which may be the firmware's default.

    A NAV-PVT gives one moment both as GPS time of week and as UTC time of day; the difference is the leap seconds.
    Returns None if the two are invalid or do not match.
    """
    of_day_s = pvt.hour * 3600 + pvt.minute * 60 + pvt.second
    seconds = round((pvt.itow_ms * 10**6 - pvt.nano) / 10**9 - of_day_s) % DAY
    return seconds if pvt.is_date_valid and pvt.is_time_valid and seconds <= MOST_LEAPS else None


def resolved(unix: int) -> int:
    """Correct a Unix time for GPS week rollover: add the 1024 weeks that old firmware leaves out."""
    while unix < EARLIEST:
        unix += ROLLOVER
    return unix


def utc_ns(pvt: NavPvt) -> int | None:
    """Return the Unix time of an epoch in ns; None until date, time and leap seconds are confirmed."""
    if not (pvt.is_date_valid and pvt.is_time_valid and pvt.is_fully_resolved and pvt.is_confirmed):
        return None
    return civil_ns(pvt.year, pvt.month, pvt.day, pvt.hour, pvt.minute, pvt.second, pvt.nano)


def civil_ns(year: int, month: int, day: int, hour: int, minute: int, second: int, nano: int) -> int | None:
    """Return the Unix time in ns of a date and a time of day; None if they are invalid.

    second  60 in a leap second, which repeats the second before.
    nano    may be negative: the moment is then in the second before.
    """
    is_date = 1980 <= year <= 2400 and 1 <= month <= 12 and 1 <= day <= calendar.monthrange(year, month)[1]
    if not (is_date and hour < 24 and minute < 60 and second <= 60):
        return None
    is_repeated = second == 60 and nano >= 0
    unix = calendar.timegm((year, month, day, hour, minute, second - is_repeated))
    return resolved(unix) * 10**9 + nano


class Pulse(NamedTuple):
    """Second that begins with a pulse: GPS time since its epoch, and Unix time; None if unknown."""

    gps: int | None
    unix: int | None


class Pulses:
    """Finds the second of each TIM-TP, a message that announces the next pulse.

    If TIM-TP counts UTC, a leap second and the second after it have the same number. Firmware may also give the leap
    second the number of the second before. Around a leap second, the time since the last pulse decides. Without a last
    pulse, the second is unknown, because a wrong second is worse than an unknown one.

    epoch_s  interval between two messages; the same pulse may be announced several times.
    """

    def __init__(self, epoch_s: float) -> None:
        self._slack = epoch_s / 2
        self._last: tuple[int, float] | None = None  # GPS time of the last pulse, and time of its first announcement

    def pulse(self, message: TimTp, leap: Leap | None, now: float, guess: int | None = None) -> Pulse:
        """Return the second of an announced pulse.

        now    in seconds of a monotonic clock.
        guess  leap seconds that the receiver uses while they are unconfirmed; they suffice to convert UTC to GPS time.
        """
        # The event of `leap` is corrected for week rollover, so the count is corrected as well.
        count = resolved(GPS_EPOCH + message.week * WEEK + round(message.tow_ms / 1000)) - GPS_EPOCH
        if not message.is_utc:
            # GLONASS and BeiDou have other epochs; the driver configures no receiver to use them.
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
        """Return the GPS time from unconfirmed leap seconds.

        The receiver may change them at any moment. Then the pulses do not continue in sequence, and the result is None.
        """
        if guess is None:
            return None
        return count + guess if self._expected(now) in (None, count + guess) else None

    def _expected(self, now: float) -> int | None:
        return None if self._last is None else self._last[0] + int(now - self._last[1] + self._slack)
