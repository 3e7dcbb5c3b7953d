"""Pairing: each rule of its table, what it lets through and what it must not."""

import itertools

import pytest

from board.time.scales import LeapEvent
from pps.refused import MEANING, Refused, Why
from pps.timemark import RELABEL_S, Acquired, Pairing, Second
from tests.pps.receiver import (
    LEAPS,
    MONOTONIC,
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


def whys(events):
    return [event.why for event in events if isinstance(event, Refused)]


def but(said, *changes):
    """The words of some seconds with others in place of those that come at the same moment; None: left out."""
    kept = {one.at: one for one in said}
    for change in changes:
        kept[change.at] = change
    return [one for one in kept.values() if one.what is not None]


def without(said, *kinds):
    return [one for one in said if not isinstance(one.what, kinds)]


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


# Edges


@pytest.mark.parametrize("late_ms", [6, 100, 500, 900, 994])
def test_an_edge_between_seconds_is_refused_and_disturbs_nothing(late_ms):
    pairing = following()
    noise = Said(4 + late_ms / 1000, pulse(4, late_ns=late_ms * 1_000_000))
    events = play(pairing, [*second(4), noise, *second(5)])
    assert labels(events) == [4, 5]
    assert whys(events) == [Why.OFF_GRID]


@pytest.mark.parametrize("late_us", [0, 1, 50, 400, 4_000])
def test_of_two_edges_of_a_second_the_one_on_the_grid_is_meant(late_us):
    bounce = pulse(4, late_ns=late_us * 1_000)._replace(sequence=99)
    events = play(following(), [*second(4), Said(4 + late_us / 1e6, bounce)])
    assert whys(events) == [Why.DUPLICATE]
    assert [event.pulse for event in events if isinstance(event, Second)] == [pulse(4)]


def test_an_edge_just_before_the_pulse_is_not_taken_for_it():
    early = pulse(4, late_ns=-3_000_000)
    events = play(following(), [Said(3.997, early), *second(4)])
    assert [event.pulse for event in events if isinstance(event, Second)] == [pulse(4)]
    assert events[-1].why is Why.DUPLICATE
    assert events[-1].pulse == early


@pytest.mark.parametrize("early_us", [30, 100, 316, 490])
@pytest.mark.parametrize("ppm", [-60, 60])
def test_edges_before_each_pulse_do_not_become_the_second(early_us, ppm):
    pairing = following(40, ppm)
    said = [
        one
        for number in range(41, 120)
        for one in [
            *second(number, late_ns=number * 7 % 5 * 400, ppm=ppm),
            Said(number - early_us / 1e6, pulse(number, -early_us * 1_000, ppm)),
        ]
    ]
    passed = [one.pulse for one in play(pairing, said) if isinstance(one, Second)]
    assert passed == [pulse(number, number * 7 % 5 * 400, ppm) for number in range(41, 120)]


def test_an_edge_of_a_second_that_was_passed_on_is_a_duplicate():
    events = play(following(), [*second(4), Said(4.2, pulse(4, late_ns=10_000))])
    assert labels(events) == [4]
    assert whys(events) == [Why.DUPLICATE]


def test_the_same_edge_told_twice_counts_once():
    events = play(following(), [*second(4), Said(4.001, pulse(4)), Said(4.3, pulse(4))])
    assert labels(events) == [4]
    assert whys(events) == [Why.DUPLICATE, Why.DUPLICATE]


@pytest.mark.parametrize("ppm", [-95, -40, 40, 95])
def test_an_oscillator_may_be_as_wrong_as_oscillators_are(ppm):
    events = play(Pairing(), seconds(0, 100, ppm))
    assert labels(events) == list(range(3, 101))


@pytest.mark.parametrize("ppm", [-95, 95])
def test_a_bounce_is_not_taken_for_the_pulse_however_wrong_the_oscillator_is(ppm):
    said = [*second(4, ppm=ppm), Said(4.00003, pulse(4, late_ns=30_000, ppm=ppm))]
    events = play(following(ppm=ppm), said)
    assert [one.pulse for one in events if isinstance(one, Second)] == [pulse(4, ppm=ppm)]


def test_after_a_late_interrupt_a_bounce_is_still_no_pulse():
    # The late one has moved the grid to where the bounces of the others are.
    pairing = following()
    assert labels(play(pairing, second(4, late_ns=90_000))) == [4]
    said = [one for number in range(5, 30) for one in [*second(number), Said(number + 9e-5, pulse(number, 90_000))]]
    events = play(pairing, said)
    assert [one.pulse for one in events if isinstance(one, Second)] == [pulse(number) for number in range(5, 30)]


def test_late_interrupts_for_a_minute_do_not_make_the_pulses_behind_them_early():
    pairing = following()
    burst = [one for number in range(4, 64) for one in second(number, late_ns=number % 7 * 400_000)]
    assert len(labels(play(pairing, burst))) == 60
    assert labels(play(pairing, seconds(64, 70))) == list(range(64, 71))


def test_edges_cannot_creep_away_from_the_grid():
    said = [one for number in range(4, 14) for one in second(number, late_ns=(number - 3) * 3_000_000)]
    assert labels(play(following(), said)) == [4]


def test_missing_pulses_are_counted_over():
    assert labels(play(following(), seconds(34, 36))) == [34, 35, 36]


# The system's clock


@pytest.mark.parametrize("step_ns", [2_000_000_000, -2_000_000_000, 500_000, -150_000_000, 10**15, -(10**15)])
def test_a_step_of_the_systems_clock_costs_no_pulse(step_ns):
    pairing = following()
    stepped = [one for number in (4, 5) for one in but(second(number), Said(number, pulse(number, system_ns=step_ns)))]
    assert labels(play(pairing, stepped)) == [4, 5]


@pytest.mark.parametrize("slew", [-0.0838, 0.0838])
def test_a_system_clock_that_is_slewed_as_fast_as_it_can_be_costs_no_pulse(slew):
    pairing = following()
    said = []
    for number in range(4, 30):
        # CLOCK_MONOTONIC, which words are stamped by, is slewed with it.
        gone = (number - 3) * (1 + slew)
        edge = pulse(number, system_ns=round((number - 3) * slew * 1e9))._replace(monotonic=MONOTONIC + 3 + gone)
        at = 3 + gone
        said += [
            Said(at - (1 + slew) * 0.95, mark(number, at=at - (1 + slew) * 0.95)),
            Said(at, edge),
            Said(at + 0.05, fix(number, at=at + 0.05)),
        ]
    events = play(pairing, said)
    assert labels(events) == list(range(4, 30))


# Late words, and a loop that stalled


@pytest.mark.parametrize("order", list(itertools.permutations(range(3))))
def test_the_order_in_which_a_turn_delivers_does_not_matter(order):
    # The loop stalled from before the announcement until after the epoch.
    words = [mark(4, at=4.3), pulse(4), fix(4, at=4.3)]
    events = play(following(), [Said(4.3 + place / 1e6, words[one]) for place, one in enumerate(order)])
    assert labels(events) == [4]
    assert whys(events) == []


def test_a_stall_of_ten_seconds_costs_no_pulse():
    pairing = following()
    numbers = range(4, 14)
    edges = [pulse(number) for number in numbers]
    found = [one for edge in edges for one in pairing.pulse(edge)]
    found += pairing.expire(MONOTONIC + 13.5)  # timers come first in a turn
    for number in numbers:
        found += pairing.fix(fix(number, at=13.5))
        found += pairing.mark(mark(number + 1, at=13.5))
    # That of 4 had come before the stall, or not at all.
    assert labels(found) == list(range(5, 14))
    found += pairing.expire(pairing.deadline())
    assert whys(found) == [Why.UNANNOUNCED]


def test_edges_that_waited_together_are_placed_one_by_the_other():
    # By an oscillator whose rate is hardly known yet, and late: the first of them moves the grid by more than 5 ms.
    pairing = following(ppm=95)
    numbers = range(59, 63)
    found = [one for number in numbers for one in pairing.pulse(pulse(number, 1_000_000, ppm=95))]
    for number in numbers:
        found += pairing.mark(mark(number, at=62.1)) + pairing.fix(fix(number, at=62.1))
    assert labels(found) == list(numbers)
    late = [one for number in range(63, 66) for one in second(number, 1_000_000, ppm=95)]
    assert labels(play(pairing, late)) == [63, 64, 65]


def test_who_was_stalled_waits_once_and_not_for_ever():
    pairing = following()
    assert pairing.pulse(pulse(4)) == []
    assert pairing.expire(MONOTONIC + 9) == []
    due = pairing.deadline()
    assert due == MONOTONIC + 9.5
    assert whys(pairing.expire(due + 5)) == [Why.UNANNOUNCED]
    assert pairing.deadline() is None


def test_a_stall_acquires_nothing():
    pairing = Pairing()
    found = [one for number in range(8) for one in pairing.pulse(pulse(number))]
    for number in range(8):
        found += pairing.mark(mark(number, at=8.5))
        found += pairing.fix(fix(number, at=8.5))
    found += play(pairing, [], until=20.0)
    assert labels(found) == []
    assert len(whys(found)) == 8


def test_words_that_are_late_by_a_second_and_a_half_make_no_pulse_good():
    pairing = following()
    late = [
        one
        for number in range(4, 20)
        for one in (
            Said(number + 0.58, mark(number, at=number + 0.58)),
            Said(float(number), pulse(number)),
            Said(number + 1.55, fix(number, at=number + 1.55)),
        )
    ]
    events = play(pairing, late)
    assert labels(events) == []
    assert {Why.UNCONFIRMED, Why.DISAGREE} >= set(whys(events))


def test_a_pulse_that_is_known_too_late_is_not_passed_on_behind_a_later_one():
    pairing = following()
    found = pairing.pulse(pulse(4)) + pairing.expire(MONOTONIC + 5.5)
    for one in second(5):
        found += play(pairing, [one], until=0.0)
    found += pairing.mark(mark(4, at=5.6)) + pairing.fix(fix(4, at=5.6))
    found += pairing.expire(MONOTONIC + 7)
    assert labels(found) == [5]
    assert whys(found) == [Why.LATE]


def test_no_more_edges_wait_than_a_minute_has():
    pairing = following()
    found = [one for number in range(4, 304) for one in pairing.pulse(pulse(number, late_ns=-number * 1_000_000))]
    assert len(found) == 300 - 64


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
