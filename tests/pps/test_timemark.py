"""Pairing: the first seconds, and what the receiver must say of each."""

import pytest

from pps.refused import MEANING, Why
from pps.timemark import Acquired, Pairing, Second
from tests.pps.pairing import but, whys, without
from tests.pps.receiver import (
    LEAPS,
    START,
    Said,
    fix,
    following,
    labels,
    mark,
    play,
    pulse,
    second,
    seconds,
    unix_s,
)

# From nothing


def test_the_fourth_second_that_agrees_is_the_first_to_be_passed_on():
    events = play(Pairing(), seconds(0, 5))
    assert whys(events) == [Why.ACQUIRING] * 3
    assert labels(events) == [3, 4, 5]


def test_an_acquisition_is_told_before_its_first_second():
    events = play(Pairing(), seconds(0, 3))
    assert events[-2] == Acquired(START + 3, 1, None)
    assert isinstance(events[-1], Second)


def test_a_second_carries_its_pulse_and_what_the_receiver_says_of_it():
    said = but(seconds(0, 3), Said(2.08, mark(3, accuracy_ns=47)))
    assert play(Pairing(), said)[-1] == Second(pulse(3), START + 3, 47, LEAPS, None, 1)


@pytest.mark.parametrize("missing", [1, 2])
def test_a_row_may_miss_a_pulse(missing):
    said = [one for number in range(6) if number != missing for one in second(number)]
    assert labels(play(Pairing(), said)) == [4, 5]


def test_a_row_does_not_outlast_a_gap():
    assert labels(play(Pairing(), seconds(0, 2) + seconds(10, 13))) == [13]


@pytest.mark.parametrize("wrong", [-1, 1])
def test_a_row_ends_where_both_jump_to_another_second(wrong):
    said = seconds(0, 2) + [
        one
        for number in (3, 4, 5, 6)
        for one in (
            Said(number - 1 + 0.08, mark(number, says=number + wrong)),
            Said(float(number), pulse(number)),
            Said(number + 0.05, fix(number, says=number + wrong)),
        )
    ]
    # Four that agree with each other are believed; three before them that do not are not counted.
    assert labels(play(Pairing(), said)) == [6 + wrong]


@pytest.mark.parametrize("wrong", [-1, 1, 1024 * 604_800])
def test_nothing_is_acquired_while_the_announcement_names_another_second_than_the_epoch(wrong):
    said = [
        one
        for number in range(20)
        for one in but(second(number), Said(number - 1 + 0.08, mark(number, says=number + wrong)))
    ]
    assert labels(play(Pairing(), said)) == []


@pytest.mark.parametrize("wrong", [-1, 1])
def test_nothing_is_acquired_while_the_epoch_names_another_second_than_the_announcement(wrong):
    said = [
        one
        for number in range(20)
        for one in but(second(number), Said(number + 0.05, fix(number, says=number + wrong)))
    ]
    events = play(Pairing(), said)
    assert labels(events) == []
    assert Why.DISAGREE in whys(events)


@pytest.mark.parametrize("wrong", [-1, 1])
def test_nothing_is_acquired_while_utc_is_off_by_a_second(wrong):
    said = [
        one
        for number in range(10)
        for one in but(second(number), Said(number + 0.05, fix(number, utc_ns=unix_s(START + number + wrong) * 10**9)))
    ]
    events = play(Pairing(), said)
    assert labels(events) == []
    assert set(whys(events)) == {Why.UTC}


def test_a_contradiction_ends_a_row():
    said = but(seconds(0, 8), Said(3.05, fix(3, says=4)))
    assert labels(play(Pairing(), said)) == [7, 8]


def test_edges_at_both_ends_of_a_pulse_are_told_apart_by_the_pause_before_them():
    trailing = [Said(number + 0.1, pulse(number, late_ns=100_000_000)) for number in range(6)]
    events = play(Pairing(), seconds(0, 5) + trailing)
    assert labels(events) == [3, 4, 5]
    assert all(event.pulse == pulse(event.its_s - START) for event in events if isinstance(event, Second))


@pytest.mark.parametrize("first", [0.1, 1.1])
def test_who_begins_to_listen_within_a_pulse_is_not_misled_by_its_end(first):
    trailing = [Said(number + 0.1, pulse(number, late_ns=100_000_000)) for number in range(7)]
    events = play(
        Pairing(), [one for one in seconds(0, 6) + trailing if one.at >= first or not hasattr(one.what, "raw_ns")]
    )
    assert labels(events) == list(range(int(first) + 4, 7))
    assert all(event.pulse == pulse(event.its_s - START) for event in events if isinstance(event, Second))


def test_noise_before_pulses_costs_nothing_of_the_row():
    noise = [Said(number + 0.7, pulse(number, late_ns=700_000_000 + number * 20_000_000)) for number in range(6)]
    events = play(Pairing(), seconds(0, 6) + noise)
    assert labels(events) == [3, 4, 5, 6]
    assert all(event.pulse == pulse(event.its_s - START) for event in events if isinstance(event, Second))


def test_a_bounce_spoils_no_row():
    bounces = [Said(number + 3e-4, pulse(number, late_ns=300_000)) for number in range(6)]
    events = play(Pairing(), seconds(0, 5) + bounces)
    assert labels(events) == [3, 4, 5]
    assert whys(events)[:2] == [Why.TRAILING, Why.ACQUIRING]


def test_pulses_of_which_nobody_speaks_are_refused():
    events = play(Pairing(), without(seconds(0, 9), type(mark(0)), type(fix(0))))
    assert whys(events) == [Why.UNANNOUNCED] * 10


# What the receiver must say


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"is_locked": False}, Why.UNLOCKED),
        ({"leap_seconds": None}, Why.UNLOCKED),
        ({"accuracy_ns": 1_001}, Why.ANNOUNCED_BADLY),
        ({"accuracy_ns": 0xFFFF_FFFF}, Why.ANNOUNCED_BADLY),
        ({"its_s": None}, Why.NO_SECOND),
        ({"its_s": START + 5}, Why.OTHER_SECOND),
        ({"its_s": START + 3}, Why.OTHER_SECOND),
        ({"its_s": START + 4 - 1024 * 604_800}, Why.OTHER_SECOND),
        ({"its_s": START + 4 + 1024 * 604_800}, Why.OTHER_SECOND),
    ],
)
def test_an_announcement_that_is_no_good_makes_its_pulse_refused(changes, why):
    pairing = following()
    events = play(pairing, but(second(4), Said(3.08, mark(4, **changes))))
    assert whys(events) == [why]
    assert labels(events) == []
    assert labels(play(pairing, second(5))) == [5]


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"utc_ns": None, "utc_accuracy_ns": None}, Why.UNRESOLVED),
        ({"utc_accuracy_ns": 1_001}, Why.CONFIRMED_BADLY),
        ({"tow_ms": None}, Why.UNCONFIRMED),
        ({"utc_ns": unix_s(START + 5) * 10**9}, Why.UTC),
        ({"utc_ns": unix_s(START + 3) * 10**9}, Why.UTC),
        ({"utc_ns": unix_s(START + 4 - 1024 * 604_800) * 10**9}, Why.UTC),
    ],
)
def test_an_epoch_that_is_no_good_makes_its_pulse_refused(changes, why):
    pairing = following()
    events = play(pairing, but(second(4), Said(4.05, fix(4, **changes))))
    assert whys(events) == [why]
    assert labels(events) == []
    assert labels(play(pairing, second(5))) == [5]


def test_accuracy_at_the_limit_is_good():
    said = but(second(4), Said(3.08, mark(4, accuracy_ns=1_000)), Said(4.05, fix(4, utc_accuracy_ns=1_000)))
    assert labels(play(following(), said)) == [4]


def test_a_pulse_without_an_announcement_is_refused():
    assert whys(play(following(), second(4)[1:])) == [Why.UNANNOUNCED]


def test_a_pulse_without_an_epoch_is_refused():
    assert whys(play(following(), second(4)[:2])) == [Why.UNCONFIRMED]


def test_the_epoch_of_the_second_before_confirms_nothing():
    pairing = following(last=2 + 1)
    events = play(pairing, [*second(4)[:2], Said(4.01, fix(3.9, at=4.01))])
    assert whys(events) == [Why.UNCONFIRMED]


def test_at_ten_epochs_a_second_any_good_one_of_the_second_confirms():
    pairing = following()
    blind = fix(4, utc_ns=None, utc_accuracy_ns=None)
    events = play(pairing, [*second(4)[:2], Said(4.05, blind), Said(4.15, fix(4.1)), Said(4.25, fix(4.2))])
    assert labels(events) == [4]


def test_an_epoch_just_before_its_second_by_a_clock_that_runs_free_confirms():
    assert labels(play(following(), [*second(4)[:2], Said(4.05, fix(3.998, at=4.05))])) == [4]


def test_a_word_that_came_before_it_can_have_been_known_is_no_witness():
    # A receiver whose announcements are a second ahead: that of 5 comes before the pulse 4, and says nothing of 5.
    pairing = following()
    said = [
        one
        for number in range(4, 10)
        for one in but(second(number), Said(number - 1 + 0.08, mark(number, says=number + 1)))
    ]
    events = play(pairing, said)
    assert labels(events) == []
    assert set(whys(events)) == {Why.OTHER_SECOND}


# What is told of it all


def test_refusals_are_counted_and_leave_a_sample():
    pairing = following()
    play(pairing, [*second(4), Said(4.5, pulse(4, late_ns=500_000_000)), Said(4.6, pulse(4, late_ns=600_000_000))])
    assert pairing.refused[Why.OFF_GRID] == 2
    assert pairing.samples[Why.OFF_GRID].detail == "-400000000 ns off second 700000005"


def test_every_reason_has_a_meaning():
    assert set(MEANING) == set(Why)


def test_without_edges_there_is_no_deadline():
    pairing = following()
    assert pairing.deadline() is None
    pairing.mark(mark(4))
    pairing.fix(fix(4))
    assert pairing.deadline() is None
    assert pairing.expire(1e9) == []
