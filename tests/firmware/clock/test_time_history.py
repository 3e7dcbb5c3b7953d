"""Time history: an hour by seconds, a day by minutes, bounded."""

import math
import sys
from itertools import pairwise

import pytest

from firmware.client.show import time_record
from firmware.clock.time_history import MINUTES, SECONDS, SHOWN, SecondRow, TimeHistory

START = 722_454_180  # begins a minute


def row(its_s: int, offset_ns: float = 5.0, phase_ns: float = 0.0) -> SecondRow:
    return SecondRow(float(its_s), offset_ns, 100.0, 7.0, phase_ns)


def kept(history: TimeHistory) -> time_record.Record:
    return time_record.record(history.told())


def test_each_second_is_read_back_as_it_was() -> None:
    history = TimeHistory()
    given = [SecondRow(START + 0.0, -1.5, 4000.25, math.nan, 0.125), SecondRow(START + 1.0, 2.0, 3.0, 4.0, math.nan)]
    for one in given:
        history.add(one)
    assert repr(kept(history).seconds) == repr(given)


def test_of_seconds_the_last_hour_is_kept_in_order() -> None:
    history = TimeHistory()
    for second in range(SECONDS + 100):
        history.add(row(START + second))
    assert [one.its_s for one in kept(history).seconds] == [START + second for second in range(100, SECONDS + 100)]


@pytest.mark.parametrize("count", [0, 1, 119, 120, 121, 500, SECONDS, SECONDS + 77, 3 * SECONDS + 1])
def test_for_a_line_of_text_there_are_as_many_rows_as_it_shows_evenly_apart_to_the_last(count: int) -> None:
    history = TimeHistory()
    for second in range(count):
        history.add(row(START + second))
    brief, whole = time_record.record(history.brief()), kept(history)
    assert len(brief.seconds) <= SHOWN
    assert len(brief.seconds) >= min(count, SHOWN // 2)
    assert brief.seconds[-1:] == whole.seconds[-1:]
    assert set(brief.seconds) <= set(whole.seconds)
    assert len({b.its_s - a.its_s for a, b in pairwise(brief.seconds)}) <= 1
    assert brief.minutes == []


def test_a_minute_has_means_the_largest_uncertainty_and_the_phase_that_begins_it() -> None:
    history = TimeHistory()
    for second in range(61):
        history.add(SecondRow(START + second, float(second), 100.0 + second % 7, 8.0, 1000.0 * second))
    (minute,) = kept(history).minutes
    assert minute == (START, 29.5, 106.0, 8.0, 0.0)


def test_a_minute_whose_first_pulse_is_missing_has_no_phase() -> None:
    history = TimeHistory()
    for second in range(1, 61):
        history.add(row(START + second))
    (minute,) = kept(history).minutes
    assert (minute.its_s, math.isnan(minute.phase_ns)) == (START, True)


def test_of_minutes_the_last_day_is_kept() -> None:
    history = TimeHistory()
    for minute in range(MINUTES + 3):
        history.add(row(START + 60 * minute))
    minutes = kept(history).minutes
    assert (len(minutes), minutes[0].its_s, minutes[-1].its_s) == (MINUTES, START + 120, START + 60 * (MINUTES + 1))


def test_nothing_known_of_a_minute_stays_unknown() -> None:
    history = TimeHistory()
    for second in (0, 60):
        history.add(SecondRow(START + second, math.nan, math.nan, math.nan, math.nan))
    (minute,) = kept(history).minutes
    assert all(math.isnan(value) for value in minute[1:])


def test_all_of_it_is_below_300_kb_from_the_start_on() -> None:
    history = TimeHistory()
    size = sum(sys.getsizeof(rows._values) for rows in (history._seconds, history._minutes))
    assert size < 300_000
    for second in range(3 * SECONDS):
        history.add(row(START + second))
    assert sum(sys.getsizeof(rows._values) for rows in (history._seconds, history._minutes)) == size


def test_a_history_of_another_form_is_none() -> None:
    told = TimeHistory().told()
    for wrong in (
        {},
        {"columns": ["its_s"]},
        told | {"seconds": "?"},
        told | {"seconds": 5},
        told | {"seconds": "AAAA"},
    ):
        assert time_record.record(wrong) == ([], [])


def test_json_has_null_for_what_is_not_known() -> None:
    (told,) = time_record.plain([SecondRow(1.0, math.nan, 2.0, 3.0, math.nan)])
    assert told == {"its_s": 1.0, "offset_ns": None, "uncertainty_ns": 2.0, "jitter_ns": 3.0, "phase_ns": None}
