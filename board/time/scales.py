"""Time scales and time reports, shared by drivers, pps and firmware.

ITS time counts all seconds since 2004, leap seconds included. Unix time leaves them out; it is converted at the edges
(board/time/leaps.py). Drivers report Fix and TimeMark; pps reports TimeQuality.
"""

from enum import IntEnum
from typing import NamedTuple

from board.runtime.errors import RequestError

# 2004-01-01T00:00:00Z as Unix time: the epoch of TimestampIts (TS 102 894-2) and of GeoNetworking's TST.
EPOCH = 1_072_915_200

# Unix time of the first second after each leap second inserted since the epoch (IERS Bulletin C 30, 36, 43,
# 49 and 52). Add a row for each new one.
LEAPS = (
    1_136_073_600,  # 2006-01-01
    1_230_768_000,  # 2009-01-01
    1_341_100_800,  # 2012-07-01
    1_435_708_800,  # 2015-07-01
    1_483_228_800,  # 2017-01-01
)
LEAPS_END = 1_782_604_800  # 2026-06-28: the list of Bulletin C 70 is complete until then

# GPS time begins at 1980-01-06T00:00:00Z, here as Unix time, and counts every second (IS-GPS-200N, clause
# 20.3.3.5.2.4). In 2004 it was 13 s ahead of UTC. ITS time counts every second too, so their difference is constant.
GPS_EPOCH = 315_964_800
GPS_LEAPS = 13
GPS_LEAD = EPOCH - GPS_EPOCH + GPS_LEAPS  # 756 950 413

# TAI was 32 s ahead of UTC from 1999 through 2005 (IERS Bulletin C 16 to 29). TAI_LEAD is TAI minus ITS time; TAI is
# counted as by CLOCK_TAI, in seconds since 1970-01-01T00:00:00 TAI.
TAI_LEAD = EPOCH + 32  # 1 072 915 232

_MAX_ITS_MS = 2**42 - 1  # TimestampIts is INTEGER (0..4398046511103)
ITS_END = 2**42 // 1000 + EPOCH - 100  # Unix time of the end of ITS time, in 2143; 100 s allow for leap seconds


def leap_seconds(utc_s: float) -> int:
    """Return the leap seconds inserted between 2004-01-01 and a Unix time: 5 since 2017-01-01.

    This uses the built-in table; the station uses the table of board/time/leaps.py.
    """
    if utc_s >= LEAPS[-1]:
        return len(LEAPS)
    return sum(utc_s >= leap for leap in LEAPS)


def its_time_ms(utc_s: float, leap_seconds: int) -> int:
    """Return the ITS time of a moment: milliseconds since 2004-01-01T00:00:00Z, leap seconds counted.

    utc_s         Unix time in seconds; rounded to the nearest millisecond.
    leap_seconds  inserted since the epoch: 5 since 2017-01-01.

    Returns 0 ... 2**42 - 1. Raises RequestError before the epoch and beyond that range.
    Source: ETSI TS 102 894-2 v2.4.1, DE TimestampIts.
    """
    its_ms = round((utc_s - EPOCH) * 1000) + leap_seconds * 1000
    if not 0 <= its_ms <= _MAX_ITS_MS:
        raise RequestError(f"Unix time {utc_s} has no ITS time: that begins in 2004 and ends in 2143")
    return its_ms


def nearest_its_time_ms(utc_s: float) -> int:
    """Return the ITS time as its_time_ms() does, or the nearest valid one; a clock may show any time."""
    return its_time_ms(min(max(utc_s, EPOCH), ITS_END), leap_seconds(utc_s))


def utc_s(its_ms: int, leap_seconds: int) -> float:
    """Return the Unix time in seconds of an ITS time in milliseconds; the inverse of its_time_ms()."""
    return EPOCH - leap_seconds + its_ms / 1000


def gn_timestamp(its_ms: int) -> int:
    """Return TST of a GeoNetworking position vector: ITS time modulo 2**32 (EN 302 636-4-1 V1.4.1 clause 9.5.2)."""
    return its_ms & 0xFFFFFFFF


def generation_delta_time(its_ms: int) -> int:
    """Return generationDeltaTime of a CAM: ITS time modulo 2**16, which wraps every 65.536 s.

    Source: ETSI EN 302 637-2 V1.4.1 clause B.3; TS 102 894-2 V2.4.1, DE GenerationDeltaTime.
    """
    return its_ms & 0xFFFF


def time32(its_ms: int) -> int:
    """Return whole seconds of ITS time, the form of certificates: 2**32 - 1 at most, in 2140.

    Raises RequestError before 2004 and after 2140.
    Source: IEEE 1609.2-2022, Ieee1609Dot2BaseTypes, Time32: TAI seconds since 2004-01-01T00:00:00 UTC.
    """
    seconds = its_ms // 1000
    if not 0 <= seconds < 2**32:
        raise RequestError(f"ITS time {its_ms} ms has no Time32: that begins in 2004 and ends in 2140")
    return seconds


class FixKind(IntEnum):
    """Kind of a position solution, numbered as NAV-PVT.fixType of u-blox F9."""

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
    """Position and time of one epoch, as the receiver reports it; unknown values are None.

    monotonic        the loop's clock at arrival.
    latitude, longitude  1e-7 degree, WGS84.
    altitude         mm above the ellipsoid.
    horizontal, vertical  accuracy estimated by the receiver, mm (u-blox: one standard deviation).
    speed            over ground, mm/s.
    heading          direction of motion, 1e-5 degree from north.
    utc_ns           Unix time of the epoch in ns; None before date, time and leap seconds are resolved.
    utc_accuracy_ns  accuracy of utc_ns.
    tow_ms           GPS time of week of the epoch, which needs no leap seconds; None if not reported.
    """

    monotonic: float
    kind: FixKind = FixKind.NONE
    latitude: int | None = None
    longitude: int | None = None
    altitude: int | None = None
    horizontal: int | None = None
    vertical: int | None = None
    speed: int | None = None
    heading: int | None = None
    satellites: int | None = None
    carrier: Carrier = Carrier.NONE
    utc_ns: int | None = None
    utc_accuracy_ns: int | None = None
    tow_ms: int | None = None


class LeapEvent(NamedTuple):
    """Announced leap second.

    its_s   ITS time of its first second: 23:59:60 if one is inserted, the missing 23:59:59 if one is removed.
    change  1 or -1.
    """

    its_s: int
    change: int


class TimeMark(NamedTuple):
    """Announcement of a receiver's next pulse.

    monotonic        the loop's clock at arrival.
    utc_s            Unix time of the second that the pulse begins; None while leap seconds are unknown.
    accuracy_ns      accuracy of the receiver's time.
    quantisation_ps  error of the pulse by the receiver's clock grid; None if unknown.
    is_locked        the pulse follows the satellites, with UTC fully resolved.
    leap_seconds     GPS time minus UTC, s, before leap_event; None if it is the firmware's default.
    its_s            ITS time of the pulse, s: known with GPS week and time of week, even before leap seconds are;
                     reliable if is_locked.
    leap_event       leap second announced by satellites, until a minute after it.
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
    """Source of the time, and its state."""

    UNKNOWN = 0  # no source
    SYSTEM = 1  # the system's clock alone, with the error that it reports
    COARSE = 2  # messages of a receiver, without pulses
    SETTLING = 3  # too few pulses yet
    LOCKED = 4  # pulses of a receiver
    HOLDOVER = 5  # the oscillator, since the last pulse


class TimeQuality(NamedTuple):
    """Current quality of the time; unknown values are None.

    offset_ns       estimate of true time minus the system's clock.
    uncertainty_ns  true time is the system's clock + offset_ns +- this, in 99.9 % of cases.
    jitter_ns       standard deviation of pulses about the estimate.
    frequency_ppb   frequency error of the oscillator, CLOCK_MONOTONIC_RAW: positive if it runs fast.
    skew_ppb        uncertainty of frequency_ppb.
    age_s           seconds since the last good pulse.
    leap            announced leap second.
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
        """Largest error of the system's clock and its time stamps, in 99.9 % of cases; None if unknown."""
        if self.offset_ns is None or self.uncertainty_ns is None:
            return None
        return abs(self.offset_ns) + self.uncertainty_ns
