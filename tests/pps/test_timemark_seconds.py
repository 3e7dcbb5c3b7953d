"""Pairing: wrong seconds, loss and return, leap seconds."""

import pytest

from board.time.scales import LeapEvent
from pps.refused import Why
from pps.timemark import RELABEL_S, Acquired, Pairing, Second
from tests.pps.pairing import but, whys
from tests.pps.receiver import (
    LEAPS,
    START,
    Said,
    event,
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

# The receiver against the seconds gone by


def wrong_for(first, last, wrong, kinds=("mark", "fix")):
    """Seconds in which the receiver says others."""
    said = []
    for number in range(first, last + 1):
        told = number + wrong
        said += [
            Said(number - 1 + 0.08, mark(number, says=told if "mark" in kinds else None)),
            Said(float(number), pulse(number)),
            Said(number + 0.05, fix(number, says=told if "fix" in kinds else None)),
        ]
    return said


@pytest.mark.parametrize("wrong", [-1, 1, -2, 18, 1024 * 604_800, -1024 * 604_800])
def test_a_receiver_that_says_another_second_is_not_believed(wrong):
    pairing = following()
    events = play(pairing, wrong_for(4, 200, wrong))
    assert labels(events) == []
    assert {Why.OTHER_SECOND, Why.DISAGREE, Why.ACQUIRING} >= set(whys(events))
    # And when it says the right one again, it is.
    assert labels(play(pairing, seconds(201, 206))) == [204, 205, 206]


@pytest.mark.parametrize("wrong", [-1, 1])
@pytest.mark.parametrize("kind", ["mark", "fix"])
def test_a_receiver_that_contradicts_itself_makes_nothing_wrong(wrong, kind):
    pairing = following()
    events = play(pairing, wrong_for(4, 50, wrong, kinds=(kind,)) + seconds(51, 60))
    # An announcement that says a second too little is like one that a stalled loop delivers: the others decide.
    assert all(one.pulse == pulse(one.its_s - START) for one in events if isinstance(one, Second))
    assert labels(events)[-6:] == list(range(55, 61))


def test_one_wrong_second_is_refused_and_the_next_right_one_passed_on_at_once():
    events = play(following(), wrong_for(4, 4, 1) + seconds(6, 8))
    assert labels(events) == [6, 7, 8]


@pytest.mark.parametrize("wrong", [-1, 1])
def test_a_receiver_that_says_another_second_for_long_enough_is_believed_and_that_is_told(wrong):
    pairing = following()
    events = play(pairing, wrong_for(4, RELABEL_S + 100, wrong))
    acquired = [one for one in events if isinstance(one, Acquired)]
    assert [one.change_s for one in acquired] == [wrong]
    assert acquired[0].its_s - wrong - START >= 4 + RELABEL_S
    assert acquired[0].series == 2
    assert all(one.series == 2 for one in events if isinstance(one, Second))
    assert labels(events)[-1] == RELABEL_S + 100 + wrong


def test_a_receiver_that_changes_its_mind_is_not_believed_for_the_sum():
    said = []
    for begin in range(4, 1004, 100):
        said += wrong_for(begin, begin + 99, 1 if begin // 100 % 2 else -1)
    assert labels(play(following(), said)) == []


def test_pulses_elsewhere_between_seconds_are_not_believed_for_long():
    said = [
        one
        for number in range(4, RELABEL_S + 200)
        for one in but(
            second(number), Said(float(number), None), Said(number - 0.2, pulse(number, late_ns=-200_000_000))
        )
    ]
    events = play(following(), said)
    first = next(one for one in events if isinstance(one, Second))
    assert first.its_s - START >= 4 + RELABEL_S
    assert next(one for one in events if isinstance(one, Acquired)).change_s == 0


# Loss and return


@pytest.mark.parametrize("gone", [3, 30, 59])
def test_after_a_short_loss_the_first_second_is_passed_on(gone):
    assert labels(play(following(), seconds(4 + gone, 5 + gone))) == [4 + gone, 5 + gone]


@pytest.mark.parametrize("gone", [62, 600, 3_900])
def test_after_a_longer_loss_four_seconds_have_to_agree_and_the_series_goes_on(gone):
    events = play(following(), seconds(4 + gone, 9 + gone))
    assert labels(events) == [7 + gone, 8 + gone, 9 + gone]
    assert not [one for one in events if isinstance(one, Acquired)]
    assert {one.series for one in events if isinstance(one, Second)} == {1}


@pytest.mark.parametrize("gone", [62, 600, 3_000])
@pytest.mark.parametrize("wrong", [-1, 1])
def test_a_receiver_that_returns_with_another_second_is_not_believed(gone, wrong):
    pairing = following()
    events = play(pairing, wrong_for(gone, gone + 760, wrong))
    assert labels(events) == []
    assert labels(play(pairing, seconds(gone + 761, gone + 766))) == [gone + 764, gone + 765, gone + 766]


@pytest.mark.parametrize("ppm", [-60, 60])
def test_after_hours_the_oscillator_may_be_off_by_a_fraction_of_a_second_and_the_second_is_found_anew(ppm):
    pairing = following(3, ppm)
    events = play(pairing, seconds(20_000, 20_005, ppm=-ppm))
    assert labels(events) == [20_003, 20_004, 20_005]
    assert [one.series for one in events if isinstance(one, Acquired)] == [2]


def test_after_hours_nothing_speaks_against_another_second():
    # The price of forgetting; a chain that remembers for longer would have to trust its oscillator for longer.
    events = play(following(), wrong_for(20_000, 20_005, 1))
    assert labels(events) == [20_004, 20_005, 20_006]


def test_noise_in_the_first_second_after_a_loss_is_not_taken_for_the_pulse():
    pairing = following()
    said = seconds(2_000, 2_009)
    said = [one for one in said if one.at != 2_000.0]  # that pulse is missing, and there is an edge 150 ms later
    events = play(pairing, [*said, Said(2_000.15, pulse(2_000, late_ns=150_000_000))])
    assert [one.pulse for one in events if isinstance(one, Second)] == [pulse(number) for number in range(2_004, 2_010)]


# Leap seconds, and the end of a week


@pytest.mark.parametrize("change", [1, -1])
def test_a_leap_second_disturbs_nothing(change):
    pairing, said = following(), []
    for number in range(4, 30):
        leap = event(15, change)
        leaps = LEAPS + change * (number > 15)
        # Two seconds to either side of it firmware may count UTC as it likes.
        whim = 0 if abs(number - 15) > 2 else (number % 3 - 1) * 10**9
        told = {"leap_seconds": LEAPS, "leap_event": leap} if number < 20 else {"leap_seconds": leaps}
        utc_ns = unix_s(START + number, leaps) * 10**9 + whim
        said += but(
            second(number),
            Said(number - 1 + 0.08, mark(number, **told)),
            Said(number + 0.05, fix(number, utc_ns=utc_ns)),
        )
    events = play(pairing, said)
    assert labels(events) == list(range(4, 30))
    leaps = [(one.leap_seconds, one.leap_event) for one in events if isinstance(one, Second)]
    assert leaps[0] == (LEAPS, LeapEvent(START + 15, change))
    assert leaps[-1] == (LEAPS + change, None)


def test_a_receiver_that_forgets_the_leap_second_is_refused_once_utc_has_to_be_right():
    said = []
    for number in range(4, 30):
        told = mark(number, leap_event=event(15))
        said += but(second(number), Said(number - 1 + 0.08, told))  # UTC goes on as if there had been none
    events = play(following(), said)
    assert labels(events) == list(range(4, 18))
    assert set(whys(events)) == {Why.UTC}


def test_the_end_of_a_week_disturbs_nothing():
    to_end = 604_800 - (START + 756_950_413) % 604_800
    pairing = Pairing()
    first, last = to_end - 8, to_end + 8
    assert labels(play(pairing, seconds(first, last))) == list(range(first + 3, last + 1))
