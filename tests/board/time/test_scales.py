"""ITS time against the standard's example, the leap seconds, and real frames."""

from datetime import UTC, datetime, timedelta
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from board.runtime.errors import RequestError
from board.time.scales import (
    EPOCH,
    GPS_LEAD,
    ITS_END,
    LEAPS,
    TAI_LEAD,
    Lock,
    TimeQuality,
    generation_delta_time,
    gn_timestamp,
    its_time_ms,
    leap_seconds,
    nearest_its_time_ms,
    time32,
    utc_s,
)
from tests.drivers.wire.captured import FRAMES

MAX_ITS_MS = 2**42 - 1
NOON = 1_795_176_000.0  # 2026-11-20T12:00:00Z


def test_its_time_matches_the_example_of_the_standard():
    # TS 102 894-2, TimestampIts: 2007-01-01T00:00:00Z is 94 694 401 000 ms
    assert its_time_ms(utc_s=1_167_609_600, leap_seconds=1) == 94_694_401_000


def test_its_time_begins_with_2004():
    assert its_time_ms(1_072_915_200, 0) == 0
    assert its_time_ms(1_072_915_200.001, 0) == 1


def test_a_moment_before_2004_has_no_its_time():
    with pytest.raises(RequestError, match="2004"):
        its_time_ms(1_072_915_199.9, 0)


@pytest.mark.parametrize(
    ("utc_s", "nearest"), [(-1e9, EPOCH), (0.0, EPOCH), (NOON, NOON), (5_471_000_000.0, ITS_END), (1e18, ITS_END)]
)
def test_the_nearest_its_time_of_any_moment_is_in_range(utc_s, nearest):
    assert nearest_its_time_ms(utc_s) == its_time_ms(nearest, leap_seconds(utc_s)) <= MAX_ITS_MS


def test_a_moment_beyond_42_bits_has_no_its_time():
    with pytest.raises(RequestError):
        its_time_ms(EPOCH + 2**42 / 1000, 5)


@pytest.mark.parametrize(
    ("moment", "inserted"),
    [
        (0, 0),
        (EPOCH, 0),
        (1_136_073_599.999, 0),
        (1_136_073_600, 1),  # 2006-01-01
        (1_230_767_999, 1),
        (1_230_768_000, 2),  # 2009-01-01
        (1_341_100_799, 2),
        (1_341_100_800, 3),  # 2012-07-01
        (1_435_708_799, 3),
        (1_435_708_800, 4),  # 2015-07-01
        (1_483_228_799, 4),
        (1_483_228_799.999, 4),
        (1_483_228_800, 5),  # 2017-01-01
        (1_795_182_426, 5),
    ],
)
def test_a_leap_second_counts_from_midnight_after_it(moment, inserted):
    assert leap_seconds(moment) == inserted


@pytest.mark.parametrize("midnight", LEAPS)
def test_its_time_runs_on_through_a_leap_second(midnight):
    before = its_time_ms(midnight - 1, leap_seconds(midnight - 1))
    after = its_time_ms(midnight, leap_seconds(midnight))
    assert after - before == 2000  # 23:59:59, 23:59:60, 00:00:00


def test_the_generation_time_of_a_captured_signature_is_its_utc():
    # cam-signed-certificate: 722 312 391 739 352 us, which tshark shows as 2026-11-21T02:19:46.739352Z
    assert utc_s(722_312_391_739, 5) == pytest.approx(1_795_227_586.739)


# Counts that wrap, at real moments: what is counted just before and at it.


def its_ms(moment: str) -> int:
    """ITS time of a moment of UTC since 2017."""
    return (datetime.fromisoformat(moment) - datetime(2004, 1, 1, tzinfo=UTC)) // timedelta(milliseconds=1) + 5000


def test_a_gn_timestamp_is_its_time_modulo_2_to_the_32():
    assert gn_timestamp(0) == 0
    assert gn_timestamp(2**32 - 1) == 2**32 - 1
    assert gn_timestamp(2**32) == 0
    assert gn_timestamp(722_312_390_739) == 757_885_011  # source timestamp of the frame above, 1 s older


@pytest.mark.parametrize(
    ("moment", "wraps"),
    [
        ("2017-08-11T00:38:44.600Z", 100),
        ("2026-11-12T07:48:20.728Z", 168),
        ("2027-01-01T00:51:08.024Z", 169),  # 51 minutes behind a turn of the year, where a leap second may be
        ("2031-03-22T01:17:34.200Z", 200),
    ],
)
def test_a_gn_timestamp_wraps_every_49_days_17_hours(moment, wraps):
    wrap = its_ms(moment)
    assert wrap == wraps * 2**32
    assert [gn_timestamp(wrap + step) for step in (-2, -1, 0, 1)] == [2**32 - 2, 2**32 - 1, 0, 1]


@pytest.mark.parametrize(
    ("moment", "leap_seconds"),
    [
        ("2016-12-31T23:59:11.968Z", 4),  # the wraps on both sides of a leap second
        ("2017-01-01T00:00:16.504Z", 5),
        ("2026-11-22T00:00:12.408Z", 5),
    ],
)
def test_a_generation_delta_time_wraps_every_65_536_ms(moment, leap_seconds):
    wrap = its_ms(moment) + (leap_seconds - 5) * 1000
    assert wrap % 65_536 == 0
    assert [generation_delta_time(wrap + step) for step in (-2, -1, 0, 1)] == [65_534, 65_535, 0, 1]


def test_a_generation_delta_time_goes_on_through_a_leap_second():
    midnight = its_ms("2017-01-01T00:00:00Z")
    counts = [generation_delta_time(midnight + step) for step in range(-2000, 1000, 10)]
    assert {(later - earlier) % 65_536 for earlier, later in pairwise(counts)} == {10}


def test_the_generation_delta_time_of_a_captured_message_is_that_of_its_signature():
    # cam-signed-certificate: signed at 722 312 391 739 ms; the CAM inside says 27 707
    signed = FRAMES["cam-signed-certificate"]
    cam = signed.index(bytes.fromhex("0202 00000001"))  # the header of a CAM of station 1
    assert generation_delta_time(722_312_391_739) == int.from_bytes(signed[cam + 6 : cam + 8]) == 27_707


def test_a_time32_is_whole_seconds_until_february_2140():
    assert time32(0) == time32(999) == 0
    assert time32(722_312_391_739) == 722_312_391
    last = its_ms("2140-02-07T06:28:10.999Z")
    assert time32(last) == 2**32 - 1
    for beyond in (last + 1, -1):
        with pytest.raises(RequestError, match="ends in 2140"):
            time32(beyond)


@given(its_ms=st.integers(0, MAX_ITS_MS), step=st.integers(0, 65_535))
@settings(deadline=None, max_examples=200)
def test_a_difference_of_wrapped_counts_is_the_true_one_while_it_is_shorter_than_a_wrap(its_ms, step):
    assert (generation_delta_time(its_ms + step) - generation_delta_time(its_ms)) & 0xFFFF == step
    assert (gn_timestamp(its_ms + step) - gn_timestamp(its_ms)) & 0xFFFFFFFF == step


def test_gps_time_and_tai_are_its_time_but_for_a_constant():
    assert GPS_LEAD == 756_950_413  # GPS time on 2004-01-01T00:00:00Z: week 1251, its fourth day, and 13 s
    assert divmod(GPS_LEAD, 604_800) == (1251, 4 * 86_400 + 13)
    midnight = its_ms("2017-01-01T00:00:00Z") // 1000
    assert midnight + GPS_LEAD == 1_483_228_800 - 315_964_800 + 18
    assert midnight + TAI_LEAD == 1_483_228_800 + 37  # TAI less UTC since 2017: IERS Bulletin C 52


def test_what_the_systems_clock_stamps_is_wrong_by_offset_and_uncertainty_at_most():
    assert TimeQuality(Lock.LOCKED, offset_ns=-3000, uncertainty_ns=500).error_ns == 3500
    assert TimeQuality(Lock.LOCKED, offset_ns=0, uncertainty_ns=0).error_ns == 0
    assert TimeQuality().error_ns is None
    assert TimeQuality(offset_ns=1).error_ns is None
    assert TimeQuality(uncertainty_ns=1).error_ns is None


@given(its_ms=st.integers(0, MAX_ITS_MS), inserted=st.integers(0, 40))
@settings(deadline=None, max_examples=200)
def test_its_time_survives_the_way_to_utc_and_back(its_ms, inserted):
    assert its_time_ms(utc_s(its_ms, inserted), inserted) == its_ms


@given(moment=st.integers(EPOCH, EPOCH + 4_000_000_000))
@settings(deadline=None, max_examples=200)
def test_whole_seconds_survive_the_way_to_its_time_and_back(moment):
    inserted = leap_seconds(moment)
    assert utc_s(its_time_ms(moment, inserted), inserted) == moment
