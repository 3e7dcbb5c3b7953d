"""ITS time against the standard's example, the leap seconds, and real frames."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from board.errors import RequestError
from board.time import EPOCH, LEAPS, gn_timestamp, its_time_ms, leap_seconds, leap_seconds_its, utc_s

MAX_ITS_MS = 2**42 - 1


def test_its_time_matches_the_example_of_the_standard():
    # TS 102 894-2, TimestampIts: 2007-01-01T00:00:00Z is 94 694 401 000 ms
    assert its_time_ms(utc_s=1_167_609_600, leap_seconds=1) == 94_694_401_000


def test_its_time_begins_with_2004():
    assert its_time_ms(1_072_915_200, 0) == 0
    assert its_time_ms(1_072_915_200.001, 0) == 1


def test_a_moment_before_2004_has_no_its_time():
    with pytest.raises(RequestError, match="2004"):
        its_time_ms(1_072_915_199.9, 0)


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


@pytest.mark.parametrize(("earlier", "midnight"), list(enumerate(LEAPS)))
def test_its_time_runs_on_through_a_leap_second(earlier, midnight):
    before = its_time_ms(midnight - 1, leap_seconds(midnight - 1))
    after = its_time_ms(midnight, leap_seconds(midnight))
    assert after - before == 2000  # 23:59:59, 23:59:60, 00:00:00
    assert leap_seconds_its(before + 999) == earlier
    assert leap_seconds_its(before + 1000) == earlier + 1
    assert leap_seconds_its(after) == earlier + 1


@pytest.mark.parametrize("midnight", LEAPS)
def test_unix_time_repeats_the_second_before_a_leap_second(midnight):
    leap = its_time_ms(midnight - 1, leap_seconds(midnight - 1)) + 1000
    assert utc_s(leap, leap_seconds_its(leap)) == midnight - 1
    assert utc_s(leap + 999, leap_seconds_its(leap + 999)) == midnight - 0.001
    assert utc_s(leap + 1000, leap_seconds_its(leap + 1000)) == midnight


def test_the_generation_time_of_a_captured_signature_is_its_utc():
    # cam-signed-certificate: 722 312 391 739 352 us, which tshark shows as 2026-11-21T02:19:46.739352Z
    assert utc_s(722_312_391_739, 5) == pytest.approx(1_795_227_586.739)


def test_a_gn_timestamp_is_its_time_modulo_2_to_the_32():
    assert gn_timestamp(0) == 0
    assert gn_timestamp(2**32 - 1) == 2**32 - 1
    assert gn_timestamp(2**32) == 0
    assert gn_timestamp(722_312_390_739) == 757_885_011  # source timestamp of the frame above, 1 s older


@given(its_ms=st.integers(0, MAX_ITS_MS))
@settings(deadline=None, max_examples=200)
def test_its_time_survives_the_way_to_utc_and_back(its_ms):
    inserted = leap_seconds_its(its_ms)
    moment = utc_s(its_ms, inserted)
    assert its_time_ms(moment, inserted) == its_ms


@given(moment=st.integers(EPOCH, EPOCH + 4_000_000_000))
@settings(deadline=None, max_examples=200)
def test_whole_seconds_survive_the_way_to_its_time_and_back(moment):
    inserted = leap_seconds(moment)
    its_ms = its_time_ms(moment, inserted)
    assert leap_seconds_its(its_ms) == inserted
    assert utc_s(its_ms, inserted) == moment
