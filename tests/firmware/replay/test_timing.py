"""When each recorded message is due."""

import pytest

from board.errors import UsageError
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
