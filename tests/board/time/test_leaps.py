"""Leap seconds by Unix, UTC and the C library, with their source."""

import os
import shutil
import subprocess
import sys
from bisect import bisect_right
from calendar import timegm
from datetime import UTC, datetime, timedelta
from itertools import pairwise

import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from board.time.leaps import BUILT_IN, LATE_S, RECEIVER, Leaps, events
from board.time.scales import EPOCH, LEAPS, LEAPS_END, LeapEvent
from tests.said import tells

NS = 10**9
STEP_NS = 10_000_000
MIDNIGHT_2012 = timegm((2012, 7, 1, 0, 0, 0))
MIDNIGHT_2017 = timegm((2017, 1, 1, 0, 0, 0))
MIDNIGHT_2028 = timegm((2028, 7, 1, 0, 0, 0))
INSERTED = BUILT_IN.rows[-1]  # 2016-12-31T23:59:60Z
# There was none so far: the second that would be 2028-06-30T23:59:59Z is left out, as all others are made up.
LEFT_OUT = LeapEvent(MIDNIGHT_2028 - 1 - EPOCH + 5, -1)
NEGATIVE = Leaps((*BUILT_IN.rows, LEFT_OUT), "made up", None)
END_NS = 2**42 * 10**6  # of ITS time


def stepped(leaps: Leaps, first_its_s: int, seconds: int) -> list[int]:
    """ITS time in steps of 10 ms."""
    return list(range(first_its_s * NS, (first_its_s + seconds) * NS, STEP_NS))


def civil(minute: str, seconds: range) -> list[str]:
    return [f"{minute}:{second:02}.{10 * step:03}Z" for second in seconds for step in range(100)]


def kernel(unix_s: int, seconds: int, midnight: int, change: int) -> list[int]:
    """Unix time in steps of 10 ms as second_overflow() of kernel/time/ntp.c has it, STA_INS or STA_DEL being set."""
    found = []
    for _ in range(seconds):
        found += range(unix_s * NS, (unix_s + 1) * NS, STEP_NS)
        unix_s += 1
        if change == 1 and unix_s == midnight:  # TIME_INS: the last second of the day once more
            unix_s, change = unix_s - 1, 0
        elif change == -1 and unix_s + 1 == midnight:  # TIME_DEL: the next second is left out
            unix_s, change = unix_s + 1, 0
    return found


@pytest.mark.parametrize("midnight", [MIDNIGHT_2012, MIDNIGHT_2017])
def test_an_inserted_second_is_stepped_through(midnight):
    first = midnight - 2 - EPOCH + LEAPS.index(midnight)
    moments = stepped(BUILT_IN, first, 5)
    last_minute = "2012-06-30T23:59" if midnight == MIDNIGHT_2012 else "2016-12-31T23:59"
    next_minute = "2012-07-01T00:00" if midnight == MIDNIGHT_2012 else "2017-01-01T00:00"
    assert [BUILT_IN.civil(its_ns) for its_ns in moments] == [
        *civil(last_minute, range(58, 61)),
        *civil(next_minute, range(2)),
    ]
    unix = [BUILT_IN.unix_ns(its_ns) for its_ns in moments]
    assert unix == kernel(midnight - 2, 5, midnight, 1)
    back = [BUILT_IN.its_ns(unix_ns) for unix_ns in unix]
    assert back == [*moments[:200], *moments[100:200], *moments[300:]]  # of two seconds with one number the first


@pytest.mark.parametrize("midnight", [MIDNIGHT_2012, MIDNIGHT_2017])
def test_unix_time_that_no_kernel_repeats_leaves_the_inserted_second_out(midnight):
    unix = range((midnight - 2) * NS, (midnight + 2) * NS, STEP_NS)
    moments = [BUILT_IN.its_ns(unix_ns) for unix_ns in unix]
    steps = [later - earlier for earlier, later in pairwise(moments)]
    assert steps == [STEP_NS] * 199 + [STEP_NS + NS] + [STEP_NS] * 199


def test_a_second_that_is_left_out_is_stepped_through():
    first = LEFT_OUT.its_s - 1  # 23:59:58
    moments = stepped(NEGATIVE, first, 3)
    assert [NEGATIVE.civil(its_ns) for its_ns in moments] == [
        *civil("2028-06-30T23:59", range(58, 59)),
        *civil("2028-07-01T00:00", range(2)),
    ]
    unix = [NEGATIVE.unix_ns(its_ns) for its_ns in moments]
    assert unix == kernel(MIDNIGHT_2028 - 2, 3, MIDNIGHT_2028, -1)
    assert [NEGATIVE.its_ns(unix_ns) for unix_ns in unix] == moments


def test_a_clock_that_was_not_told_to_leave_a_second_out_is_a_second_late():
    late_ns = (MIDNIGHT_2028 - 1) * NS + 250_000_000  # it shows 23:59:59.25, and it is 00:00:00.25
    assert NEGATIVE.civil(NEGATIVE.its_ns(late_ns)) == "2028-07-01T00:00:00.250Z"


def test_a_negative_part_of_a_second_is_of_the_second_before():
    assert BUILT_IN.civil(-1) == "2003-12-31T23:59:59.999Z"
    assert BUILT_IN.civil(INSERTED.its_s * NS - 1) == "2016-12-31T23:59:59.999Z"
    assert BUILT_IN.civil((INSERTED.its_s + 1) * NS - 1) == "2016-12-31T23:59:60.999Z"


def test_its_time_is_5_seconds_ahead_of_utc_since_2017():
    # TS 102 894-2 V2.4.1, TimestampIts: "As of 1 January, 2022, TimestampIts is 5 seconds ahead of UTC"
    unix_ns = timegm((2022, 1, 1, 0, 0, 0)) * NS
    assert BUILT_IN.its_ns(unix_ns) - (unix_ns - EPOCH * NS) == 5 * NS
    assert [BUILT_IN.leap_seconds(row.its_s * NS - 1) for row in BUILT_IN.rows] == [0, 1, 2, 3, 4]
    assert [BUILT_IN.leap_seconds(row.its_s * NS) for row in BUILT_IN.rows] == [1, 2, 3, 4, 5]


def test_its_time_matches_the_example_of_the_standard():
    # TS 102 894-2, TimestampIts: 2007-01-01T00:00:00Z is 94 694 401 000 ms
    assert BUILT_IN.its_ns(timegm((2007, 1, 1, 0, 0, 0)) * NS) == 94_694_401_000 * 10**6
    assert BUILT_IN.civil(94_694_401_000 * 10**6) == "2007-01-01T00:00:00.000Z"


def test_the_first_and_the_last_moment_of_its_time():
    assert BUILT_IN.civil(0) == "2004-01-01T00:00:00.000Z"
    assert BUILT_IN.civil(END_NS - 1) == "2143-05-15T07:35:06.103Z"


def test_before_2004_none_is_counted():
    assert BUILT_IN.its_ns(0) == -EPOCH * NS
    assert BUILT_IN.civil(-EPOCH * NS) == "1970-01-01T00:00:00.000Z"


def test_the_next_leap_second_is_told_until_it_begins():
    assert NEGATIVE.next(0) == BUILT_IN.rows[0]
    assert NEGATIVE.next(INSERTED.its_s * NS - 1) == INSERTED
    assert NEGATIVE.next(INSERTED.its_s * NS) == LEFT_OUT
    assert NEGATIVE.next(LEFT_OUT.its_s * NS) is None
    assert Leaps((), "", None).next(0) is None


# The C library knows leap seconds, where zic has made it a time zone that counts them. All that is made here is of
# 2004 and later, so that its time is ITS time but for a constant.

CHANGES = st.lists(st.integers(0, 2 * 138), unique=True, max_size=20).map(sorted)


def midnight_of(half_year: int) -> int:
    """Unix time of the begin of a half-year since July 2004."""
    year, half = divmod(half_year + 1, 2)
    return timegm((2004 + year, 1 + 6 * half, 1, 0, 0, 0))


def table(half_years: list[int], changes: list[int]) -> Leaps:
    midnights = map(midnight_of, half_years)
    return Leaps(events(zip(midnights, changes, strict=False)), "made up", None)


TABLES = st.builds(table, CHANGES, st.lists(st.sampled_from([1, -1]), min_size=20, max_size=20))


def asked_of_libc(leaps: list[tuple[datetime, int]], its_s: list[int], folder) -> list[str]:
    """UTC of seconds of ITS time, by zic and the C library."""
    zic = shutil.which("zic", path=f"{os.environ['PATH']}:/usr/sbin")
    assert zic is not None, "zic is needed, of the package libc-bin"
    lines = [
        f"Leap\t{last:%Y\t%b\t%d}\t23:59:{60 if change > 0 else 59}\t{'+' if change > 0 else '-'}\tS"
        for last, change in leaps
    ]
    (folder / "leapseconds").write_text("\n".join(lines) + "\n")
    (folder / "zone").write_text("Zone Leap 0 - UTC\n")
    subprocess.run([zic, "-b", "fat", "-d", folder, "-L", folder / "leapseconds", folder / "zone"], check=True)
    program = "import sys, time\nfor line in sys.stdin:\n print(time.strftime('%FT%T', time.localtime(int(line))))"
    asked = "\n".join(str(second + EPOCH) for second in its_s)
    ran = subprocess.run(
        [sys.executable, "-c", program],
        input=asked,
        capture_output=True,
        text=True,
        check=True,
        env={"TZ": f":{folder}/Leap"},
    )
    return ran.stdout.split()


def test_the_c_library_has_the_same_utc_for_each_second_around_each_leap_second(tmp_path):
    leaps = [(datetime.fromtimestamp(midnight - 1, UTC), 1) for midnight in LEAPS]
    seconds = [row.its_s + step for row in BUILT_IN.rows for step in range(-3, 4)]
    seconds += list(range(0, 4_000_000_000, 7_654_321))
    ours = [BUILT_IN.civil(second * NS)[:19] for second in seconds]
    assert ours == asked_of_libc(leaps, seconds, tmp_path)
    assert ours[3] == "2005-12-31T23:59:60"


def test_the_c_library_leaves_the_same_seconds_out(tmp_path):
    halves, changes = [3, 9, 10, 24, 40, 41, 60], [1, -1, -1, 1, -1, 1, -1]
    leaps = table(halves, changes)
    told = [
        (datetime.fromtimestamp(midnight_of(half) - 1, UTC), change)
        for half, change in zip(halves, changes, strict=True)
    ]
    seconds = [row.its_s + step for row in leaps.rows for step in range(-3, 4)]
    assert [leaps.civil(second * NS)[:19] for second in seconds] == asked_of_libc(told, seconds, tmp_path)


# Properties, of any table of leap seconds that are inserted or left out at the turns of half-years.


@given(leaps=TABLES, its_ns=st.integers(0, END_NS))
@settings(deadline=None, max_examples=150)
def test_its_time_survives_the_way_to_unix_time_and_back_but_for_a_second_that_repeats_another(leaps, its_ns):
    is_repeat = any(row.change > 0 and 0 <= its_ns - row.its_s * NS < NS for row in leaps.rows)
    assert leaps.its_ns(leaps.unix_ns(its_ns)) == its_ns - is_repeat * NS


@given(leaps=TABLES, unix_ns=st.integers(EPOCH * NS, EPOCH * NS + END_NS))
@settings(deadline=None, max_examples=150)
def test_unix_time_survives_the_way_to_its_time_and_back_but_for_a_second_that_there_is_not(leaps, unix_ns):
    there = leaps.unix_ns(leaps.its_ns(unix_ns))
    left_out = [row for row in leaps.rows if row.change < 0 and leaps.its_ns(unix_ns) // NS == row.its_s]
    assert there == unix_ns or (left_out and there == unix_ns + NS)


@given(leaps=TABLES, its_ns=st.integers(0, END_NS - 2 * NS), step_ns=st.integers(1, 2 * NS))
@settings(deadline=None, max_examples=150)
def test_utc_goes_on_with_its_time(leaps, its_ns, step_ns):
    assert leaps.civil(its_ns) <= leaps.civil(its_ns + step_ns)
    assert leaps.civil(its_ns) < leaps.civil(its_ns + NS)


@given(leaps=TABLES, its_ns=st.integers(0, END_NS))
@settings(deadline=None, max_examples=150)
def test_utc_is_as_far_from_2004_as_its_time_less_its_leap_seconds(leaps, its_ns):
    text = leaps.civil(its_ns)
    assume(":60." not in text)
    ms = (datetime.fromisoformat(text) - datetime(2004, 1, 1, tzinfo=UTC)) // timedelta(milliseconds=1)
    counted = sum(row.change for row in leaps.rows[: bisect_right([row.its_s for row in leaps.rows], its_ns // NS)])
    assert ms == its_ns // 10**6 - counted * 1000


# By the word of a receiver.

NOW = 722_267_232  # 2026-11-22
COMING = LeapEvent(timegm((2027, 1, 1, 0, 0, 0)) - EPOCH + 5, 1)
LISTED = Leaps(BUILT_IN.rows, "/list", timegm((2027, 6, 28, 0, 0, 0)))


def test_a_receiver_that_says_what_is_known_is_the_source_and_nobody_doubts():
    told = LISTED.told(18, None, NOW)
    assert told == Leaps(BUILT_IN.rows, RECEIVER, None, base=LISTED)
    assert told.told(18, None, NOW + 1) is told


def test_a_receiver_that_announces_what_is_listed_is_not_doubted():
    listed = Leaps((*BUILT_IN.rows, COMING), "/list", LISTED.expires)
    assert listed.told(18, COMING, NOW) == Leaps(listed.rows, RECEIVER, None, base=listed)
    assert listed.told(18, None, NOW) == Leaps(listed.rows, RECEIVER, None, base=listed)


def test_an_announced_leap_second_is_in_the_table_before_and_after_it():
    for its_s in (NOW, COMING.its_s - 1, COMING.its_s, COMING.its_s + 60):
        told = LISTED.told(18, COMING, its_s)
        assert told.rows == (*BUILT_IN.rows, COMING)
        assert told.civil(COMING.its_s * NS) == "2026-12-31T23:59:60.000Z"
    assert LISTED.told(19, None, COMING.its_s + 61).rows == (*BUILT_IN.rows, COMING)


def test_an_announcement_that_is_withdrawn_is_in_the_table_no_more_but_for_what_is_listed():
    announced = LISTED.told(18, COMING, NOW)
    assert announced.told(18, COMING, NOW + 1) is announced
    assert announced.told(18, None, NOW + 2) == LISTED.told(18, None, NOW + 2)
    listed = Leaps((*BUILT_IN.rows, COMING), "/list", LISTED.expires)
    assert listed.told(18, COMING, NOW).told(18, None, NOW + 1).rows == listed.rows


def test_leap_second_that_was_announced_stays_after_it():
    # At the end of March, which no leap second was so far, and which nobody would guess
    event = LeapEvent(timegm((2027, 4, 1, 0, 0, 0)) - EPOCH + 5, 1)
    told = LISTED.told(18, event, NOW).told(18, event, event.its_s + 60)
    for since_s in (61, LATE_S, 10_000_000):
        told = told.told(19, None, event.its_s + since_s)
        assert told.rows == (*BUILT_IN.rows, event)
    assert told.civil(event.its_s * NS) == "2027-03-31T23:59:60.000Z"
    assert tells(told.doubt, "receiver announces", "inserted", "2027-03-31")


def test_announcement_that_a_list_denies_is_believed_and_both_are_named():
    told = LISTED.told(18, COMING, NOW)
    assert tells(told.doubt, "leap seconds: ", "receiver announces", "inserted", "2026-12-31; ", "/list", "2027-06-28")
    gone = LISTED.told(18, LeapEvent(COMING.its_s - 1, -1), NOW)
    assert tells(gone.doubt, "receiver announces", "removed", "2026-12-31")
    assert gone.civil((COMING.its_s - 1) * NS) == "2027-01-01T00:00:00.000Z"


def test_an_announcement_of_what_an_expired_table_cannot_know_is_not_doubted():
    assert timegm((2027, 1, 1, 0, 0, 0)) > LEAPS_END
    assert BUILT_IN.told(18, COMING, NOW).doubt == ""


@pytest.mark.parametrize(("says", "counted"), [(19, 6), (17, 4), (20, 7), (16, 3)])
def test_receiver_that_counts_otherwise_is_believed_and_both_counts_are_named(says, counted):
    told = LISTED.told(says, None, NOW)
    assert told.leap_seconds(NOW * NS) == counted
    assert tells(told.doubt, "leap seconds: ", f" {says} s ", "receiver", " 18 s ", "/list", "2027-06-28")
    assert told.civil((INSERTED.its_s) * NS) == "2016-12-31T23:59:60.000Z"  # what was before is as it was


def test_a_leap_second_that_came_between_list_and_receiver_is_placed_at_the_turn_of_the_half_year():
    now = timegm((2027, 1, 3, 0, 0, 0)) - EPOCH + 6
    told = BUILT_IN.told(19, None, now)
    assert told.rows == (*BUILT_IN.rows, COMING)
    assert told.its_ns(timegm((2027, 1, 3, 0, 0, 0)) * NS) == now * NS


def test_the_turn_of_the_half_year_is_that_of_utc_by_the_receivers_count():
    midnight = timegm((2027, 1, 1, 0, 0, 0)) - EPOCH + 6
    assert BUILT_IN.told(19, None, midnight).rows[-1] == COMING
    assert BUILT_IN.told(19, None, midnight - 1).rows[-1] == (timegm((2026, 7, 1, 0, 0, 0)) - EPOCH + 5, 1)


def test_listed_leap_second_that_the_receiver_does_not_count_is_withdrawn_once_it_is_late():
    listed = Leaps((*BUILT_IN.rows, COMING), "/list", LISTED.expires)
    for late_s in (0, 1, LATE_S - 1):
        assert listed.told(18, None, COMING.its_s + late_s).rows == listed.rows
    told = listed.told(18, None, COMING.its_s + LATE_S)
    assert told.rows == BUILT_IN.rows
    assert tells(told.doubt, " 18 s ", "receiver", " 19 s ", "/list")


@pytest.mark.parametrize("before_s", [10_000, 1, 0, -1, -60])
@pytest.mark.parametrize("change", [1, -1])
def test_a_receiver_that_announces_the_contrary_of_what_is_listed_is_believed(before_s, change):
    midnight = timegm((2027, 1, 1, 0, 0, 0))
    listed = Leaps(BUILT_IN.rows + events([(midnight, -change)], 5), "/list", midnight)
    (event,) = events([(midnight, change)], 5)
    told = listed.told(18, event, event.its_s - before_s)
    assert told.rows == (*BUILT_IN.rows, event)


def test_the_receivers_event_takes_the_place_of_all_to_come():
    later = LeapEvent(COMING.its_s + 15_552_001, 1)
    listed = Leaps((*BUILT_IN.rows, later), "/list", later.its_s + EPOCH)
    assert listed.told(18, COMING, NOW).rows == (*BUILT_IN.rows, COMING)
    both = Leaps((*BUILT_IN.rows, COMING, later), "/list", later.its_s + EPOCH)
    assert both.told(18, LeapEvent(later.its_s - 1, 1), NOW).rows == (*BUILT_IN.rows, (later.its_s - 1, 1))


@given(
    leaps=TABLES,
    its_s=st.integers(LATE_S, END_NS // NS),
    says=st.integers(13 - 20, 13 + 40),
    ahead_s=st.integers(-60, 10_000_000),
    change=st.sampled_from([None, 1, -1]),
)
@example(leaps=Leaps((), "", None), its_s=1_341_100_780, says=-7, ahead_s=1, change=1)  # at a half-year's turn
@settings(deadline=None, max_examples=150)
def test_whatever_a_receiver_says_is_counted_now_and_the_table_stays_one(leaps, its_s, says, ahead_s, change):
    event = None if change is None else LeapEvent(its_s + ahead_s, change)
    told = leaps.told(says, event, its_s)
    then_s = its_s if event is None else min(its_s, event.its_s - 1)
    assert says - 13 in (told.leap_seconds(then_s * NS), told.leap_seconds((then_s - LATE_S) * NS))
    assert [row.its_s for row in told.rows] == sorted({row.its_s for row in told.rows})
    if event is not None:
        assert told.rows[-1] == event or event in leaps.rows
        assert told.leap_seconds(event.its_s * NS) - told.leap_seconds(event.its_s * NS - 1) == event.change
    assert told.told(says, event, its_s).rows == told.rows
