"""Pairing: edges, steps of the system clock, late words and stalls."""

import itertools

import pytest

from pps.refused import Why
from pps.timemark import Pairing, Second
from tests.pps.pairing import but, whys
from tests.pps.receiver import (
    MONOTONIC,
    Said,
    fix,
    following,
    labels,
    mark,
    play,
    pulse,
    second,
    seconds,
)

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
