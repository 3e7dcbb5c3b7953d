"""ITS time and UTC: milliseconds since 2004 that count leap seconds, and seconds since 1970 that do not."""

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

_MAX_ITS_MS = 2**42 - 1  # TimestampIts is INTEGER (0..4398046511103)


def leap_seconds(utc_s: float) -> int:
    """Leap seconds inserted between 2004-01-01 and a moment in Unix time: 5 since 2017-01-01."""
    if utc_s >= LEAPS[-1]:
        return len(LEAPS)
    return sum(utc_s >= leap for leap in LEAPS)


def leap_seconds_its(its_ms: int) -> int:
    """Leap seconds inserted between 2004-01-01 and a moment in ITS time.

    A leap second counts from its own first millisecond on: Unix time, which has no number for it, repeats the
    second before it, as the Linux kernel does.
    """
    return sum(its_ms >= (leap - EPOCH + earlier) * 1000 for earlier, leap in enumerate(LEAPS))


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


def utc_s(its_ms: int, leap_seconds: int) -> float:
    """Unix time in seconds of an ITS time in milliseconds; the inverse of its_time_ms()."""
    return EPOCH - leap_seconds + its_ms / 1000


def gn_timestamp(its_ms: int) -> int:
    """TST of a GeoNetworking position vector: ITS time modulo 2**32 (EN 302 636-4-1 V1.4.1 clause 9.5.2)."""
    return its_ms & 0xFFFFFFFF
