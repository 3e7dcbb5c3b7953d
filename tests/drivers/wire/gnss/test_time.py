"""Seconds of pulses and epochs: leap seconds, ends of weeks, old firmware, early clocks."""

import calendar

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from board.time.scales import GPS_EPOCH
from drivers.wire.gnss.time import EARLIEST, ROLLOVER, WEEK, Leap, Pulses, civil_ns, counted, leap_of, resolved, utc_ns
from drivers.wire.ublox.messages import NavPvt, decode
from drivers.wire.ublox.time import NavTimeLs, TimTp
from drivers.wire.ublox.ubx import Kind, UbxFrame

UTC, UTC_AVAILABLE = 1, 2

# The last leap second that was inserted: 2016-12-31T23:59:60Z, the 18th since 1980.
MIDNIGHT = calendar.timegm((2017, 1, 1, 0, 0, 0))
EVENT = MIDNIGHT - GPS_EPOCH + 17  # GPS time of 23:59:60
LEAP_2016 = Leap(17, EVENT, 1)
NOW = calendar.timegm((2026, 6, 1, 8, 0, 0))


def pvt(**fields):
    message = decode(UbxFrame(Kind.NAV_PVT, bytes(92)))
    assert isinstance(message, NavPvt)
    known = {"year": 2026, "month": 6, "day": 1, "hour": 8, "valid": 7, "flags2": 0xE0}
    return message._replace(**{**known, **fields})


def timels(to_event_s=0, leap=18, change=0, source=2, valid=3):
    return NavTimeLs(0, 0, source, leap, source, change, to_event_s, 0, 0, valid)


def tim_tp(count, flags=UTC | UTC_AVAILABLE, reference=0x30):
    return TimTp(count % WEEK * 1000, 0, 0, count // WEEK, flags, reference)


def test_an_epoch_is_in_the_second_that_it_says():
    assert utc_ns(pvt(second=5, nano=200_000_000)) == NOW * 10**9 + 5_200_000_000


def test_a_negative_nano_is_in_the_second_before():
    assert utc_ns(pvt(nano=-123_456)) == NOW * 10**9 - 123_456


@pytest.mark.parametrize(
    "doubt",
    [
        {"valid": 6},
        {"valid": 5},
        {"valid": 3},
        {"flags2": 0xA0},
        {"flags2": 0x60},
        {"month": 13},
        {"day": 31},
        {"day": 0},
        {"hour": 24},
        {"minute": 60},
        {"second": 61},
        {"year": 1979},
        {"year": 2401},
    ],
)
def test_a_time_with_any_doubt_is_none(doubt):
    assert utc_ns(pvt(**doubt)) is None


def test_the_last_day_of_a_leap_year_is_one():
    assert utc_ns(pvt(year=2024, month=2, day=29)) == calendar.timegm((2024, 2, 29, 8, 0, 0)) * 10**9
    assert utc_ns(pvt(year=2026, month=2, day=29)) is None
    assert utc_ns(pvt(month=12, day=31)) == calendar.timegm((2026, 12, 31, 8, 0, 0)) * 10**9


def test_a_receiver_that_cannot_confirm_its_time_is_believed():
    assert utc_ns(pvt(flags2=0)) == NOW * 10**9


@pytest.mark.parametrize(
    ("civil", "unix_ns"),
    [
        ((2016, 12, 31, 23, 59, 59, 0), (MIDNIGHT - 1) * 10**9),
        ((2016, 12, 31, 23, 59, 60, -5), MIDNIGHT * 10**9 - 5),
        ((2016, 12, 31, 23, 59, 60, 0), (MIDNIGHT - 1) * 10**9),
        ((2016, 12, 31, 23, 59, 60, 500_000_000), (MIDNIGHT - 1) * 10**9 + 500_000_000),
        ((2017, 1, 1, 0, 0, 0, -5), MIDNIGHT * 10**9 - 5),
        ((2017, 1, 1, 0, 0, 0, 0), MIDNIGHT * 10**9),
    ],
)
def test_a_leap_second_repeats_the_one_before_as_the_kernel_does(civil, unix_ns):
    assert civil_ns(*civil) == unix_ns


def test_leap_seconds_of_the_firmware_are_not_known():
    assert leap_of(timels(source=0), NOW) is None
    assert leap_of(timels(source=255), NOW) is None
    assert leap_of(timels(valid=0), NOW) is None
    assert leap_of(timels(), NOW) == Leap(18)


@pytest.mark.parametrize("wrong_s", [-1, 0, 1, 17, 18])
def test_an_announced_leap_second_is_at_the_end_of_its_day_whatever_firmware_counts_to(wrong_s):
    day_before = MIDNIGHT - 86_400
    assert leap_of(timels(86_400 + wrong_s, leap=17, change=1), day_before) == LEAP_2016


def test_an_announced_change_without_a_date_or_one_that_has_passed_is_none():
    assert leap_of(timels(100, change=1), None) == Leap(18)
    assert leap_of(timels(-100, change=1), NOW) == Leap(18)


def test_unix_time_of_gps_seconds_repeats_a_second_that_is_inserted():
    around = [LEAP_2016.unix(EVENT + step) - MIDNIGHT for step in range(-2, 4)]
    assert around == [-2, -1, -1, 0, 1, 2]


def test_unix_time_of_gps_seconds_leaves_a_second_out_that_is_removed():
    leap = leap_of(timels(100, leap=18, change=-1), MIDNIGHT - 100)
    assert leap is not None
    last = MIDNIGHT - GPS_EPOCH + 18 - 2  # 23:59:58
    assert [leap.unix(last + step) - MIDNIGHT for step in range(-1, 3)] == [-3, -2, 0, 1]


def pulses_of(messages, leap, period=1.0, late=lambda at: 0.03):
    """Return the Unix times of announced pulses. Each is announced 1 s before, with a delay of `late`."""
    pulses = Pulses(period)
    return [pulses.pulse(message, leap, at * period + late(at)).unix for at, message in enumerate(messages)]


def test_the_next_pulse_counts_utc_without_leap_seconds_where_it_says_so():
    count = NOW - GPS_EPOCH
    assert pulses_of([tim_tp(count)], Leap(18)) == [NOW]


def test_the_next_pulse_counts_leap_seconds_where_it_is_of_gps_or_galileo():
    count = NOW - GPS_EPOCH + 18
    assert pulses_of([tim_tp(count, 2, reference) for reference in (0, 3)], Leap(18)) == [NOW, NOW]


@pytest.mark.parametrize("reference", [1, 2, 15])
def test_a_pulse_of_another_system_is_not_known(reference):
    assert pulses_of([tim_tp(0, 2, reference)], Leap(18)) == [None]


def test_a_pulse_of_utc_without_leap_seconds_is_not_known():
    assert Pulses(1.0).pulse(tim_tp(1000), None, 0.0) == (None, None)


def test_a_pulse_of_gps_without_leap_seconds_has_no_unix_time():
    count = NOW - GPS_EPOCH
    assert Pulses(1.0).pulse(tim_tp(count, 2, 0), None, 0.0) == (count, None)


def test_a_receiver_shows_which_leap_seconds_it_counts_whether_it_knows_them_or_guesses():
    assert counted(pvt(itow_ms=(8 * 3600 + 16) * 1000)) == 16
    assert counted(pvt(itow_ms=(86_400 + 8 * 3600 + 18) * 1000, nano=-123_456)) == 18
    assert counted(pvt(itow_ms=(8 * 3600 + 18) * 1000 + 200, nano=200_000_412)) == 18
    assert counted(pvt(itow_ms=(8 * 3600 + 18) * 1000 + 800, nano=799_999_588)) == 18
    assert counted(pvt(itow_ms=17_000, hour=0)) == 17
    assert counted(pvt(itow_ms=0, hour=0)) == 0
    assert counted(pvt(itow_ms=127_000, hour=0)) == 127


def test_the_leap_seconds_that_are_counted_change_behind_the_leap_second_and_at_the_end_of_a_week():
    assert counted(pvt(itow_ms=17_000, hour=23, minute=59, second=60)) == 17
    assert counted(pvt(itow_ms=18_000, hour=0)) == 18
    assert counted(pvt(itow_ms=0, hour=23, minute=59, second=42)) == 18


@pytest.mark.parametrize("doubt", [{"itow_ms": 0}, {"itow_ms": 28_928_000}, {"valid": 1}, {"valid": 2}, {"valid": 0}])
def test_an_epoch_that_says_two_moments_or_none_counts_no_leap_seconds(doubt):
    assert counted(pvt(**{"itow_ms": (8 * 3600 + 16) * 1000, **doubt})) is None


@pytest.mark.parametrize("guess", [0, 13, 16, 18])
def test_a_guess_of_leap_seconds_is_enough_for_gps_time_of_a_pulse_and_not_for_unix_time(guess):
    gps = NOW - GPS_EPOCH + 18
    assert Pulses(1.0).pulse(tim_tp(gps - guess), None, 0.0, guess) == (gps, None)


def test_a_pulse_that_the_receiver_counts_by_a_newer_guess_than_ours_is_not_known():
    pulses, gps = Pulses(1.0), NOW - GPS_EPOCH + 18
    said = [(16, 16), (16, 16), (18, 16), (18, 18), (18, 18)]  # leap seconds: message, last epoch
    found = [
        pulses.pulse(tim_tp(gps + at - theirs), None, at + 0.03, ours).gps for at, (theirs, ours) in enumerate(said)
    ]
    assert found == [gps, gps + 1, None, gps + 3, gps + 4]


@pytest.mark.parametrize("leap", [Leap(18), LEAP_2016, Leap(18, EVENT, -1)])
def test_an_announced_change_is_told_in_its_time(leap):
    event = leap.announced
    assert event == (None if leap.event is None else (leap.event - 756_950_413, leap.change))


@pytest.mark.parametrize("flags", [UTC | UTC_AVAILABLE, UTC_AVAILABLE])
def test_seconds_go_on_across_the_end_of_a_week(flags):
    leap = 0 if flags & UTC else 18
    first = 2400 * WEEK - 3
    messages = [tim_tp(first + step, flags, 0) for step in range(6)]
    assert messages[2].tow_ms == 604_799_000
    assert messages[3].tow_ms == 0
    assert pulses_of(messages, Leap(18)) == [GPS_EPOCH + first - leap + step for step in range(6)]


def test_the_end_of_a_week_may_be_said_as_its_last_second_plus_one():
    message = TimTp(WEEK * 1000, 0, 0, 2399, 3, 0x30)
    assert pulses_of([message], Leap(18)) == [GPS_EPOCH + 2400 * WEEK]


@pytest.mark.parametrize("repeats", [True, False])
@pytest.mark.parametrize("rate", [1, 5, 10])
@pytest.mark.parametrize("jitter_s", [0.0, 0.02])
def test_the_pulses_around_a_leap_second_are_told_apart_however_they_are_numbered(repeats, rate, jitter_s):
    true = [EVENT + step for step in range(-5, 6)]
    label = MIDNIGHT - GPS_EPOCH - 1 if repeats else MIDNIGHT - GPS_EPOCH
    counts = [label if gps == EVENT else LEAP_2016.unix(gps) - GPS_EPOCH for gps in true]
    pulses = Pulses(1 / rate)
    for second, (gps, count) in enumerate(zip(true, counts, strict=True)):
        for epoch in range(rate):
            now = second + epoch / rate + 0.03 + jitter_s * (epoch % 2)
            assert pulses.pulse(tim_tp(count), LEAP_2016, now) == (gps, LEAP_2016.unix(gps))


def test_after_a_leap_second_the_new_number_is_counted():
    count = MIDNIGHT - GPS_EPOCH + 1000
    assert pulses_of([tim_tp(count)], LEAP_2016) == [MIDNIGHT + 1000]
    assert Pulses(1.0).pulse(tim_tp(count), LEAP_2016, 0.0).gps == count + 18


def test_the_weeks_that_old_firmware_leaves_out_are_put_back():
    assert resolved(NOW - ROLLOVER) == NOW
    assert resolved(NOW) == NOW
    assert resolved(EARLIEST) == EARLIEST
    assert utc_ns(pvt(year=2006, month=10, day=16)) == NOW * 10**9
    count = NOW - GPS_EPOCH - ROLLOVER
    assert pulses_of([tim_tp(count)], Leap(18)) == [NOW]


@pytest.mark.parametrize("label", range(-1, 2))
def test_a_first_pulse_beside_a_leap_second_is_not_known_rather_than_a_second_wrong(label):
    count = MIDNIGHT - GPS_EPOCH + label
    assert Pulses(1.0).pulse(tim_tp(count), LEAP_2016, 0.0) == (None, None)


def test_a_receiver_that_began_beside_a_leap_second_knows_its_pulses_behind_it():
    pulses = Pulses(1.0)
    found = [pulses.pulse(tim_tp(MIDNIGHT - GPS_EPOCH + step), LEAP_2016, step).unix for step in range(6)]
    assert found[0] is None
    assert found[3:] == [MIDNIGHT + 3, MIDNIGHT + 4, MIDNIGHT + 5]


@pytest.mark.parametrize("flags", [UTC | UTC_AVAILABLE, UTC_AVAILABLE])
def test_an_announced_leap_second_is_met_by_firmware_that_leaves_weeks_out(flags):
    event = NOW + 3600 * 16  # end of the day with the leap second
    leap = leap_of(timels(3600 * 16, change=1), NOW)
    assert leap == Leap(18, event - GPS_EPOCH + 18, 1)
    for after in (-10, 10):
        count = event + after - GPS_EPOCH - ROLLOVER + (0 if flags & UTC else 18 + (after > 0))
        assert pulses_of([tim_tp(count, flags, 0)], leap) == [event + after]


@given(
    change=st.sampled_from([1, -1]),
    begin=st.integers(-8, 4),
    heard=st.lists(st.booleans(), min_size=16, max_size=16),
    is_utc=st.booleans(),
    repeats=st.booleans(),
    late_s=st.lists(st.floats(0.0, 0.3), min_size=16, max_size=16),
)
@settings(deadline=None, max_examples=300)
def test_around_a_leap_second_no_pulse_is_ever_given_a_wrong_second(change, begin, heard, is_utc, repeats, late_s):
    event = MIDNIGHT - GPS_EPOCH + 17 - (change < 0)
    leap, pulses = Leap(17, event, change), Pulses(1.0)
    for at in range(16):
        gps = event + begin + at
        utc = leap.unix(gps) - GPS_EPOCH + (change > 0 and gps == event and not repeats)
        message = tim_tp(utc if is_utc else gps, UTC_AVAILABLE | is_utc, 0)
        if heard[at]:
            found = pulses.pulse(message, leap, at + late_s[at])
            assert found in ((gps, leap.unix(gps)), (None, None))
            assert found.gps is not None or (is_utc and abs(gps - event) <= 4)


@given(
    guess=st.integers(10, 25),
    learnt_at=st.integers(0, 10),
    lag=st.integers(0, 1),
    heard=st.lists(st.booleans(), min_size=12, max_size=12),
)
@settings(deadline=None, max_examples=200)
def test_while_leap_seconds_are_learnt_no_pulse_is_ever_given_a_wrong_second(guess, learnt_at, lag, heard):
    first, pulses, before = NOW - GPS_EPOCH + 18, Pulses(1.0), None
    for at in range(12):
        counts, ours = (18 if at >= learnt_at else guess), (18 if at >= learnt_at + lag else guess)
        if heard[at]:
            leap = Leap(18) if at > learnt_at + lag else None
            found = pulses.pulse(tim_tp(first + at - counts), leap, at + 0.03, ours)
            # Without an earlier pulse, the change since the last epoch cannot be detected.
            assert found.gps in (first + at, None) or (before is None and counts != ours)
            before = found.gps
