"""What both sides of the station say about time: the scales, and what is known by whom.

ITS time counts all seconds since 2004, so that a leap second has a number of its own; Unix time, which is made from it
at the edges, leaves them out (board/leaps.py knows which). Drivers say Fix and TimeMark; pps says TimeQuality.
"""

from enum import IntEnum
from typing import NamedTuple

from board.errors import RequestError

# 2004-01-01T00:00:00Z as Unix time: the epoch of TimestampIts (TS 102 894-2) and of GeoNetworking's TST.
EPOCH = 1_072_915_200

# Unix time of the first second after each leap second inserted since the epoch (IERS Bulletin C 30, 36, 43,
# 49 and 52). A new one is one more row.
LEAPS = (
    1_136_073_600,  # 2006-01-01
    1_230_768_000,  # 2009-01-01
    1_341_100_800,  # 2012-07-01
    1_435_708_800,  # 2015-07-01
    1_483_228_800,  # 2017-01-01
)
LEAPS_END = 1_782_604_800  # 2026-06-28, until which the list of Bulletin C 70 says that these are all

# GPS time begins with 1980-01-06T00:00:00Z, here as Unix time, and leaves no second out (IS-GPS-200N, clause
# 20.3.3.5.2.4). In 2004 it was 13 s ahead of UTC: GPS time of a moment less its ITS time is the same for ever.
GPS_EPOCH = 315_964_800
GPS_LEAPS = 13
GPS_LEAD = EPOCH - GPS_EPOCH + GPS_LEAPS  # 756 950 413

# TAI was 32 s ahead of UTC from 1999 through 2005 (IERS Bulletin C 16 to 29): TAI as CLOCK_TAI counts it, in seconds
# since 1970-01-01T00:00:00 TAI, less ITS time.
TAI_LEAD = EPOCH + 32  # 1 072 915 232

_MAX_ITS_MS = 2**42 - 1  # TimestampIts is INTEGER (0..4398046511103)
ITS_END = 2**42 // 1000 + EPOCH - 100  # Unix time, in 2143, from which on ITS time has no number; leap seconds left out


def leap_seconds(utc_s: float) -> int:
    """Leap seconds inserted between 2004-01-01 and a moment in Unix time: 5 since 2017-01-01.

    Of the table built in; board/leaps.py has that by which the station goes.
    """
    if utc_s >= LEAPS[-1]:
        return len(LEAPS)
    return sum(utc_s >= leap for leap in LEAPS)


def its_time_ms(utc_s: float, leap_seconds: int) -> int:
    """ITS time of a moment: milliseconds since 2004-01-01T00:00:00Z, leap seconds counted.

    utc_s         Unix time in seconds; rounded to the nearest millisecond.
    leap_seconds  inserted since the epoch: 5 since 2017-01-01.

    Returns 0 ... 2**42 - 1. Raises RequestError before the epoch and beyond that range.
    Source: ETSI TS 102 894-2 v2.4.1, DE TimestampIts.
    """
    its_ms = round((utc_s - EPOCH) * 1000) + leap_seconds * 1000
    if not 0 <= its_ms <= _MAX_ITS_MS:
        raise RequestError(f"Unix time {utc_s} has no ITS time: that begins in 2004 and ends in 2143")
    return its_ms


def nearest_its_time_ms(utc_s: float, leap_seconds: int) -> int:
    """As its_time_ms(), but the first or the last ITS time for a moment that has none: a clock may show any."""
    return its_time_ms(min(max(utc_s, EPOCH), ITS_END), leap_seconds)


def utc_s(its_ms: int, leap_seconds: int) -> float:
    """Unix time in seconds of an ITS time in milliseconds; the inverse of its_time_ms()."""
    return EPOCH - leap_seconds + its_ms / 1000


def gn_timestamp(its_ms: int) -> int:
    """TST of a GeoNetworking position vector: ITS time modulo 2**32 (EN 302 636-4-1 V1.4.1 clause 9.5.2)."""
    return its_ms & 0xFFFFFFFF


def generation_delta_time(its_ms: int) -> int:
    """generationDeltaTime of a CAM: ITS time modulo 2**16, every 65.536 s anew.

    Source: ETSI EN 302 637-2 V1.4.1 clause B.3; TS 102 894-2 V2.4.1, DE GenerationDeltaTime.
    """
    return its_ms & 0xFFFF


def time32(its_ms: int) -> int:
    """Whole seconds of ITS time, as certificates have them: 2**32 - 1 at most, in 2140.

    Source: IEEE 1609.2-2022, Ieee1609Dot2BaseTypes, Time32: TAI seconds since 2004-01-01T00:00:00 UTC.
    """
    seconds = its_ms // 1000
    if not 0 <= seconds < 2**32:
        raise RequestError(f"ITS time {its_ms} ms has no Time32: that begins in 2004 and ends in 2140")
    return seconds


class FixKind(IntEnum):
    """How a position was found, numbered as NAV-PVT.fixType of u-blox F9."""

    NONE = 0
    DEAD_RECKONING = 1
    FLAT = 2  # two dimensions
    FULL = 3  # three dimensions
    COMBINED = 4  # satellites and dead reckoning
    TIME_ONLY = 5


class Carrier(IntEnum):
    """State of the carrier phase ambiguities: none, float, or fixed (RTK)."""

    NONE = 0
    FLOAT = 1
    FIXED = 2


class Fix(NamedTuple):
    """What a receiver says of place and time at one epoch; what it does not know is None.

    monotonic      the loop's clock when it came.
    latitude, longitude  1e-7 degree, WGS84. altitude in mm above the ellipsoid.
    horizontal, vertical  accuracy as the receiver estimates it (u-blox: one standard deviation), mm.
    speed          over ground, mm/s, with its accuracy. heading: of motion, 1e-5 degree from north, with its accuracy.
    utc_ns         Unix time of the epoch in ns; None before date, time and leap seconds are resolved.
    utc_accuracy_ns  of it.
    tow_ms         GPS time of week of the epoch, which needs no leap seconds; None where the receiver does not say it.
    """

    monotonic: float
    kind: FixKind = FixKind.NONE
    latitude: int | None = None
    longitude: int | None = None
    altitude: int | None = None
    horizontal: int | None = None
    vertical: int | None = None
    speed: int | None = None
    speed_accuracy: int | None = None
    heading: int | None = None
    heading_accuracy: int | None = None
    satellites: int | None = None
    carrier: Carrier = Carrier.NONE
    utc_ns: int | None = None
    utc_accuracy_ns: int | None = None
    tow_ms: int | None = None


class LeapEvent(NamedTuple):
    """A change of the leap seconds that is announced.

    its_s   first ITS second that it has to do with: 23:59:60 itself where one is inserted, the one that would have
            been 23:59:59 where one is left out.
    change  1, or -1.
    """

    its_s: int
    change: int


class TimeMark(NamedTuple):
    """What a receiver says of its next pulse.

    monotonic        the loop's clock when it was said.
    utc_s            Unix time of the second that the pulse begins; None while leap seconds are not known.
    accuracy_ns      of the receiver's time.
    quantisation_ps  error of the pulse by the receiver's clock grid; None where it is not known.
    is_locked        whether the pulse follows the satellites, with UTC fully resolved.
    leap_seconds     GPS time less UTC, s, before leap_event; None where it is the firmware's default.
    its_s            ITS time of the pulse, s: known with GPS week and time of week, even before leap seconds are;
                     beyond doubt where is_locked.
    leap_event       announced by satellites, and told for a minute after it.
    """

    monotonic: float
    utc_s: int | None
    accuracy_ns: int
    quantisation_ps: int | None
    is_locked: bool
    leap_seconds: int | None
    its_s: int | None = None
    leap_event: LeapEvent | None = None


class Lock(IntEnum):
    """Whose word the time is."""

    UNKNOWN = 0  # nobody's
    SYSTEM = 1  # the system's clock alone, as exact as it says itself
    COARSE = 2  # a receiver's messages, without pulses
    SETTLING = 3  # pulses, and not enough of them
    LOCKED = 4  # pulses
    HOLDOVER = 5  # the oscillator's, since pulses came last


class TimeQuality(NamedTuple):
    """How well the time is known, now; what is not known is None.

    offset_ns       estimate of true time less the system's clock.
    uncertainty_ns  the truth is within +- this of the system's clock and offset, in 99.9 % of cases.
    jitter_ns       standard deviation of pulses about the estimate.
    frequency_ppb   of the oscillator, CLOCK_MONOTONIC_RAW, against the truth: positive where it runs fast.
    skew_ppb        uncertainty of that.
    age_s           since the last good pulse.
    leap            that is announced.
    source          interface of the receiver.
    """

    state: Lock = Lock.UNKNOWN
    offset_ns: int | None = None
    uncertainty_ns: int | None = None
    jitter_ns: int | None = None
    frequency_ppb: float | None = None
    skew_ppb: float | None = None
    age_s: float | None = None
    leap: LeapEvent | None = None
    source: str = ""

    @property
    def error_ns(self) -> int | None:
        """The system's clock, and what it stamps, is no further from the truth than this, in 99.9 % of cases."""
        if self.offset_ns is None or self.uncertainty_ns is None:
            return None
        return abs(self.offset_ns) + self.uncertainty_ns
