"""When each recorded message is due."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from board.runtime.errors import UsageError
from firmware.replay.timing import Schedule, Timing

SECOND = 1_000_000_000
RECORDED = [5 * SECOND, 6 * SECOND, 8 * SECOND, 7 * SECOND, 15 * SECOND]


def schedule(timing: Timing, times: list[int] | list[None] | list[int | None]) -> list[float | None]:
    one = Schedule(timing)
    return [one.due(when) for when in times]


@pytest.mark.parametrize(
    ("timing", "due"),
    [
        (Timing(), [0, 1, 3, 3, 10]),
        (Timing(speed=2), [0, 0.5, 1.5, 1.5, 5]),
        (Timing(rate=4), [0, 0.25, 0.5, 0.75, 1]),
        (Timing(rate=0), [0, 0, 0, 0, 0]),
        (Timing(from_s=1, to_s=3), [None, 0, 2, 2, None]),
        (Timing(from_s=1, rate=10), [None, 0, 0.1, 0.2, 0.3]),
    ],
)
def test_each_is_due_as_it_was_recorded_unless_told_otherwise(timing: Timing, due: list[float | None]):
    assert schedule(timing, RECORDED) == pytest.approx(due)


def test_what_has_no_time_follows_ten_times_a_second():
    assert schedule(Timing(), [None, None, SECOND, None, 2 * SECOND]) == pytest.approx([0, 0.1, 0.1, 0.2, 1.0])


def test_a_part_of_what_has_no_time_cannot_be_found():
    with pytest.raises(UsageError, match="does not say when"):
        schedule(Timing(from_s=1), [None])


def test_another_round_begins_as_long_after_the_last_as_they_were_apart():
    one = Schedule(Timing())
    for when in (0, SECOND, 4 * SECOND):
        one.due(when)
    assert one.end == pytest.approx(6)


def test_a_clock_that_was_set_is_not_waited_for():
    day = 86_400 * SECOND
    one = Schedule(Timing())
    recorded = [SECOND, 2 * SECOND, 20_000 * day, 20_000 * day + SECOND, 19_000 * day, 19_000 * day + SECOND]
    assert [one.due(when) for when in recorded] == pytest.approx([0, 1, 61, 62, 62, 63])
    assert one.steps == 2


@given(times=st.lists(st.integers(-(10**19), 10**19), max_size=50), longest=st.floats(0.0, 100.0))
def test_whatever_the_times_each_is_due_no_later_than_the_longest_gap_after_the_last(times, longest):
    one = Schedule(Timing(longest_gap_s=longest))
    last = 0.0
    for when in times:
        due = one.due(when)
        assert due is not None
        assert last <= due <= last + longest + 1.0 + abs(when) * 1e-15
        last = due
