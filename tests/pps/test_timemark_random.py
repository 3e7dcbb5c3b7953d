"""Pairing amid faults that chance has chosen: no second that is wrong, whatever the order of words."""

from typing import NamedTuple

from hypothesis import given, settings
from hypothesis import strategies as st

from pps.timemark import Pairing, Second
from tests.pps.receiver import FIX_S, MARK_S, MONOTONIC, Said, fix, labels, mark, play, pulse, second, seconds

ACQUIRED = 6  # seconds without faults at first: nothing tells a receiver that is wrong from its first word on
FALSE = 10_000  # sequence numbers of edges that begin no second


class Fault(NamedTuple):
    """Of one second.

    gap            seconds before it of which there is nothing.
    mark, fix      what they are off by; None: there is none.
    mark_late, fix_late  s.
    extra          further edges, s after the second's beginning.
    """

    gap: int = 0
    has_pulse: bool = True
    mark: int | None = 0
    fix: int | None = 0
    mark_late: float = 0.0
    fix_late: float = 0.0
    is_locked: bool = True
    is_resolved: bool = True
    late_ns: int = 0
    step_ns: int = 0
    extra: tuple[float, ...] = ()


OFF = st.sampled_from([0, 0, 0, 1, -1, 2, -1024 * 604_800, 1024 * 604_800, None])
BOTH = st.sampled_from([1, -1, 2, -1024 * 604_800]).map(lambda off: Fault(mark=off, fix=off))
LATE = st.one_of(st.just(0.0), st.just(0.0), st.floats(0, 4))
FAULTS = st.builds(
    Fault,
    gap=st.one_of(st.just(0), st.just(0), st.integers(0, 90)),
    has_pulse=st.integers(0, 5).map(bool),
    mark=OFF,
    fix=OFF,
    mark_late=LATE,
    fix_late=LATE,
    is_locked=st.integers(0, 5).map(bool),
    is_resolved=st.integers(0, 5).map(bool),
    late_ns=st.one_of(st.just(0), st.integers(-100, 600_000)),
    step_ns=st.one_of(st.just(0), st.integers(-(10**12), 10**12)),
    extra=st.lists(st.floats(0.001, 0.999), max_size=2).map(tuple),
)
# A fault stays for some seconds; all of them together for less than makes a receiver believed.
SPELLS = st.tuples(st.one_of(FAULTS, BOTH), st.integers(1, 12))


def spells(most: int) -> st.SearchStrategy[list[Fault]]:
    """Faults second by second, up to so many spells of them."""
    return st.lists(SPELLS, max_size=most).map(_flat)


def _flat(found: list[tuple[Fault, int]]) -> list[Fault]:
    return [fault._replace(gap=fault.gap * (number == 0)) for fault, count in found for number in range(count)]


def turns(faults: list[Fault]) -> list[list[Said]]:
    """By second: edges in their order, NAV-PVT, and TIM-TP of the next; words that are late stay in theirs."""
    found, number, system_ns = [], ACQUIRED, 0
    for fault in faults:
        if fault.gap:
            number += fault.gap
            found.append([_mark(number, fault)])  # of the second that begins it
        system_ns += fault.step_ns
        edges = [Said(number + at, _false(number, at, system_ns)) for at in fault.extra]
        if fault.has_pulse:
            edges.append(Said(float(number), pulse(number, fault.late_ns, system_ns=system_ns)))
        found.append([*sorted(edges, key=lambda one: one.at), *_fix(number, fault), _mark(number + 1, fault)])
        number += 1
    return found


def _false(number, at, system_ns):
    return pulse(number, round(at * 1e9), system_ns=system_ns)._replace(sequence=FALSE + number)


def _mark(number, fault):
    at = number - 1 + MARK_S + fault.mark_late
    off = fault.mark
    word = mark(number, at=at, says=number + (off or 0), is_locked=fault.is_locked)
    return Said(at, word if off is not None else word._replace(its_s=None))


def _fix(number, fault):
    if fault.fix is None:
        return []
    at = number + FIX_S + fault.fix_late
    word = fix(number, at=at, says=number + fault.fix)
    return [Said(at, word if fault.is_resolved else word._replace(utc_ns=None, utc_accuracy_ns=None))]


def begun() -> Pairing:
    pairing = Pairing()
    assert labels(play(pairing, seconds(0, ACQUIRED - 1), until=ACQUIRED - 0.9)) == [3, 4, 5]
    pairing.mark(mark(ACQUIRED))
    return pairing


def is_right(event: Second) -> bool:
    """Whether it is the second of its edge, which a false one can only be where nobody could tell it from the pulse."""
    off_ns = event.pulse.raw_ns - pulse(event.its_s - 700_000_000).raw_ns
    return abs(off_ns) <= 15_000_000


@given(spells(16))
@settings(max_examples=150)
def test_no_second_that_is_passed_on_is_wrong(faults):
    said = [one for turn in turns(faults) for one in turn]
    events = play(begun(), said)
    assert all(is_right(event) for event in events if isinstance(event, Second))
    passed = labels(events)
    assert passed == sorted(set(passed))


@given(spells(8))
@settings(max_examples=60)
def test_after_any_trouble_four_good_seconds_are_enough(faults):
    said = [one for turn in turns(faults) for one in turn]
    last = max([round(one.at) for one in said], default=ACQUIRED) + 6
    pairing = begun()
    play(pairing, said)
    assert labels(play(pairing, seconds(last, last + 5)))[-3:] == [last + 3, last + 4, last + 5]


@given(spells(5), st.randoms(use_true_random=False))
@settings(max_examples=100)
def test_the_order_of_words_within_a_second_does_not_matter(faults, random):
    # Edges come one behind the other; what a line says is read before them, between, or after.
    straight, shuffled = begun(), begun()
    for turn in turns([fault._replace(mark_late=0.0, fix_late=0.0) for fault in faults]):
        expected, found = _turn(straight, turn), _turn(shuffled, _shuffled(turn, random))
        assert labels(expected) == labels(found)


def _shuffled(turn, random):
    edges = [one for one in turn if hasattr(one.what, "sequence")]
    order = random.sample(turn, len(turn))
    rest = iter(edges)
    return [next(rest) if hasattr(one.what, "sequence") else one for one in order]


def _turn(pairing, turn):
    events = []
    for one in turn:
        told = {"Pulse": pairing.pulse, "TimeMark": pairing.mark, "Fix": pairing.fix}[type(one.what).__name__]
        events += told(one.what)
    end = max(int(one.at) for one in turn) + 0.95
    while (due := pairing.deadline()) is not None and due <= MONOTONIC + end:
        events += pairing.expire(due)
    return events


@given(st.lists(st.tuples(st.floats(0, 60), st.sampled_from("pmfe"), st.integers(-3, 60)), max_size=80))
@settings(max_examples=100)
def test_words_and_edges_without_any_sense_raise_nothing_and_wait_for_no_more_than_their_time(words):
    pairing, told = Pairing(), 0
    for at, kind, number in sorted(words):
        match kind:
            case "p":
                told += len(pairing.pulse(pulse(at)))
            case "m":
                told += len(pairing.mark(mark(number, at=at)))
            case "f":
                told += len(pairing.fix(fix(number, at=at)))
            case "e":
                told += len(pairing.expire(MONOTONIC + at))
    for at in range(61, 70):
        told += len(pairing.expire(MONOTONIC + at))
    assert pairing.deadline() is None
    assert told >= sum(kind == "p" for _, kind, _ in words)


def test_the_sequences_above_would_show_a_wrong_second():
    # The same check, with a pairing that has been told wrongly from the first word on.
    pairing = Pairing()
    wrong = [
        Said(one.at, mark(round(one.at + 0.9), says=round(one.at + 0.9) + 1))
        if hasattr(one.what, "leap_event")
        else one
        for number in range(8)
        for one in second(number)
    ]
    wrong = [
        Said(one.at, fix(round(one.at), says=round(one.at) + 1)) if hasattr(one.what, "tow_ms") else one
        for one in wrong
    ]
    events = [event for event in play(pairing, wrong) if isinstance(event, Second)]
    assert events
    assert not any(is_right(event) for event in events)
