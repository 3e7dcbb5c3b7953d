"""The fate of each message on one way: arrived, lost, come twice, too late, out of order; and what is not known."""

import math
from collections import Counter
from collections.abc import Iterable

from hypothesis import given, settings
from hypothesis import strategies as st

from firmware.meter.event import NO_CLOCK, Clock, ReceivedEvent, Sent
from firmware.meter.fate import Fate, Settled, Way
from firmware.meter.figures import Figures
from firmware.meter.matching import Matching
from tests.firmware.meter.events import received, sent

WAY = Way("A", "air", "B", "air")


def fates(
    *events: Sent | ReceivedEvent,
    grace_s: float = 1.0,
    since_s: float = -math.inf,
    silent: Iterable[tuple[float, float]] = (),
) -> list[Settled]:
    """Of all, in the order in which they were heard of."""
    matching = Matching(WAY, grace_s)
    matching.since_s = since_s
    for span in silent:
        matching.silent(*span)
    settled: list[Settled] = []
    for event in sorted(events, key=lambda event: event.at_s):
        settled += matching.settle(event.at_s)
        _feed(matching, event)
    return settled + matching.settle(math.inf)


def _feed(matching: Matching, event: Sent | ReceivedEvent) -> None:
    if isinstance(event, Sent):
        matching.sent(event)
    else:
        matching.received(event)


def counts(settled: Iterable[Settled]) -> dict[Fate, int]:
    return dict(Counter(one.fate for one in settled))


def test_what_was_sent_and_received_has_arrived() -> None:
    (one,) = fates(sent(1, 0.0), received(1, 0.004))
    assert (one.fate, one.is_reordered, one.is_repeat) == (Fate.ARRIVED, False, False)
    assert one.sent is not None
    assert one.received is not None
    assert one.received.received_ns - one.sent.handed_ns == 4_000_000


def test_it_does_not_matter_whose_word_comes_first() -> None:
    (one,) = fates(sent(1, 0.0, heard_s=0.9), received(1, 0.004))
    assert one.fate is Fate.ARRIVED


def test_what_was_not_received_is_lost_and_not_before_twice_the_grace() -> None:
    matching = Matching(WAY, grace_s=1.0)
    matching.sent(sent(1, 0.0))
    assert matching.settle(1.99) == []
    assert [one.fate for one in matching.settle(2.0)] == [Fate.LOST]
    assert matching.settle(math.inf) == []


def test_what_comes_after_that_is_late_and_no_duplicate() -> None:
    assert counts(fates(sent(1, 0.0), sent(2, 5.0), received(1, 5.0), received(2, 5.1))) == {
        Fate.LOST: 1,
        Fate.LATE: 1,
        Fate.ARRIVED: 1,
    }


def test_what_was_under_way_for_longer_than_the_grace_is_late_whenever_one_looks() -> None:
    for step in (0.01, 0.3, 5.0):
        matching = Matching(WAY, grace_s=1.0)
        matching.sent(sent(1, 0.0))
        matching.sent(sent(2, 0.5))
        settled = []
        now_s, fed = 0.0, False
        while now_s < 20.0:
            now_s += step
            if now_s >= 1.5 and not fed:
                fed = True
                matching.received(received(2, 0.6))
                matching.received(received(1, 1.5))
            settled += matching.settle(now_s)
        told = [(one.fate, one.is_reordered) for one in settled if one.received is not None]
        assert told == [(Fate.ARRIVED, False), (Fate.LATE, True)], step


def test_what_comes_once_more_than_it_was_sent_is_a_duplicate() -> None:
    assert [one.fate for one in fates(sent(1, 0.0), received(1, 0.01), received(1, 0.02))] == [
        Fate.ARRIVED,
        Fate.DUPLICATE,
    ]


def test_what_was_never_sent_is_strange() -> None:
    assert [one.fate for one in fates(sent(1, 0.0), received(1, 0.01), received(2, 0.02))] == [
        Fate.ARRIVED,
        Fate.STRANGE,
    ]


def test_what_overtakes_makes_the_other_one_reordered_as_rfc_4737_has_it() -> None:
    order = (0, 2, 3, 1, 4)
    settled = fates(
        *(sent(n, n * 0.01) for n in range(5)), *(received(n, 0.1 + at * 0.01) for at, n in enumerate(order))
    )
    assert [one.is_reordered for one in settled] == [False, False, False, True, False]


def test_a_station_that_tells_of_urgent_messages_first_has_not_reordered_them() -> None:
    settled = fates(
        *(sent(n, n * 0.01) for n in range(3)),
        *(received(n, n * 0.01 + 0.001, heard_s=0.05 + at * 0.001) for at, n in enumerate((2, 0, 1))),
    )
    assert [(one.is_reordered, one.copy) for one in settled] == [(False, 0)] * 3


def test_repeats_of_a_pdu_are_taken_for_the_last_one_that_was_sent_before() -> None:
    """Every tenth of a second the same octets, and the first of them is lost: the others' delays are their own."""
    settled = fates(
        *(sent("same", n * 0.1) for n in range(10)), *(received("same", n * 0.1 + 0.004) for n in range(1, 10))
    )
    assert counts(settled) == {Fate.ARRIVED: 9, Fate.LOST: 1}
    assert {
        one.received.received_ns - one.sent.handed_ns for one in settled if one.sent is not None and one.received
    } == {4_000_000}
    assert [one.copy for one in settled] == [*range(1, 10), 0]
    assert all(one.is_repeat for one in settled if one.received)  # though nobody knows that they are not one before it


def test_without_clocks_repeats_are_taken_in_their_order() -> None:
    settled = fates(
        *(sent("same", n * 0.1, clock=NO_CLOCK) for n in range(3)),
        *(received("same", n * 0.1 + 77.0, clock=NO_CLOCK, heard_s=n * 0.1 + 0.05) for n in range(3)),
    )
    assert [(one.fate, one.copy) for one in settled] == [(Fate.ARRIVED, 0), (Fate.ARRIVED, 1), (Fate.ARRIVED, 2)]


def test_clocks_that_are_known_to_be_wrong_match_as_well() -> None:
    """The receiver's clock is 3 s ahead, and it says so."""
    ahead = Clock("other", offset_ns=-3_000_000_000, uncertainty_ns=1_000_000)
    exact = Clock("boot", 0, 1_000_000)
    settled = fates(
        *(sent("same", n * 0.1, clock=exact) for n in range(5)),
        *(received("same", n * 0.1 + 3.01, clock=ahead, heard_s=n * 0.1 + 0.02) for n in range(1, 5)),
    )
    assert [(one.fate, one.copy) for one in settled] == [(Fate.ARRIVED, n) for n in range(1, 5)] + [(Fate.LOST, 0)]


def test_a_stamp_that_is_a_little_off_is_no_reason_to_call_a_message_lost() -> None:
    assert counts(fates(sent(1, 0.010), received(1, 0.002))) == {Fate.ARRIVED: 1}


def test_what_the_meter_did_not_hear_is_not_lost() -> None:
    matching = Matching(WAY, grace_s=1.0)
    for n in range(4):
        matching.sent(sent(n, n * 0.1))
    matching.unheard(2, 0.0, 0.3)  # of the four two may have arrived
    assert counts(matching.settle(math.inf)) == {Fate.UNSEEN: 2, Fate.LOST: 2}


def test_what_the_meter_did_not_hear_long_ago_excuses_nothing() -> None:
    matching = Matching(WAY, grace_s=1.0)
    matching.unheard(math.inf, 0.0, 0.3)
    matching.sent(sent(1, 5.0))
    assert counts(matching.settle(math.inf)) == {Fate.LOST: 1}


def test_the_word_of_a_station_that_was_silent_corrects_what_was_strange() -> None:
    """Its confirms come 5 s late, all at once: nothing of that was lost, and the delays are those that they had."""
    settled = fates(
        *(sent(n, n * 0.1, heard_s=6.0) for n in range(5)), *(received(n, n * 0.1 + 0.004) for n in range(5))
    )
    assert counts(settled) == {Fate.STRANGE: 5, Fate.ARRIVED: 5}
    assert [one.was for one in settled if one.fate is Fate.ARRIVED] == [Fate.STRANGE] * 5
    figures = Figures()
    for one in settled:
        figures.add(one)
    assert (figures.sent, figures.lost, figures.counts[Fate.STRANGE]) == (5, 0, 0)
    assert figures.link_us.quantiles(0.0, 1.0) == [4000.0, 4000.0]


def test_what_was_unseen_and_is_heard_of_after_all_has_arrived() -> None:
    matching = Matching(WAY, grace_s=1.0)
    matching.unheard(math.inf, 0.0, 4.0)
    matching.sent(sent(1, 0.0))
    (unseen,) = matching.settle(5.0)
    matching.received(received(1, 0.004, heard_s=6.0))
    (one,) = matching.settle(8.0)
    assert (unseen.fate, one.fate, one.was) == (Fate.UNSEEN, Fate.ARRIVED, Fate.UNSEEN)


def test_a_late_word_corrects_nothing_after_a_minute() -> None:
    matching = Matching(WAY, grace_s=1.0)
    matching.sent(sent(1, 0.0))
    matching.settle(100.0)
    matching.received(received(1, 0.004, heard_s=100.0))
    assert [one.fate for one in matching.settle(math.inf)] == [Fate.DUPLICATE]


def test_of_a_constant_pdu_that_is_slower_than_it_is_sent_no_delay_is_told() -> None:
    """The same octets every 0.1 s, 0.15 s under way, a tenth of them lost: which copy it was nobody knows."""
    lost = range(4, 60, 10)
    settled = fates(
        *(sent("same", n * 0.1) for n in range(60)),
        *(received("same", n * 0.1 + 0.15) for n in range(60) if n not in lost),
        grace_s=2.0,
    )
    figures = Figures()
    for one in settled:
        figures.add(one)
    assert (figures.sent, figures.arrived, figures.lost) == (60, 54, 6)
    assert (figures.one_way_us.count, figures.link_us.count, figures.reordered) == (0, 0, 0)


def test_of_a_constant_pdu_that_arrives_before_the_next_is_sent_delays_are_told() -> None:
    settled = fates(*(sent("same", n * 0.1) for n in range(60)), *(received("same", n * 0.1 + 0.05) for n in range(60)))
    assert not any(one.is_repeat for one in settled)


def test_of_a_constant_pdu_that_flowed_before_the_meter_came_no_delay_is_told() -> None:
    """0.15 s under way: each reception looks as if it were of the copy that was sent 0.05 s before."""
    settled = fates(
        *(sent("same", n * 0.1) for n in range(100)),
        *(received("same", n * 0.1 + 0.05) for n in range(100)),
        since_s=-0.02,
    )
    assert all(one.is_repeat for one in settled)
    assert counts(settled) == {Fate.ARRIVED: 100}


def test_of_a_constant_pdu_what_was_sent_while_nobody_heard_its_sender_is_no_duplicate() -> None:
    """Before the meter came, for a while in between, and after it left: the receiver is heard all the time."""
    settled = fates(
        *(sent("same", n * 0.1) for n in range(100) if not 40 <= n < 50),
        *(received("same", n * 0.1 + 0.05) for n in range(-20, 120)),
        grace_s=2.0,
        since_s=-0.02,
        silent=[(3.98, 4.98), (9.98, math.inf)],
    )
    assert counts(settled) == {Fate.ARRIVED: 90, Fate.STRANGE: 50}


def test_of_a_constant_pdu_what_comes_twice_while_its_sender_is_heard_is_a_duplicate() -> None:
    settled = fates(
        *(sent("same", n * 0.1) for n in range(60)),
        *(received("same", n * 0.1 + 0.05) for n in range(60)),
        received("same", 3.06),
        grace_s=2.0,
        since_s=-0.02,
        silent=[(5.98, math.inf)],
    )
    assert counts(settled) == {Fate.ARRIVED: 60, Fate.DUPLICATE: 1}


def test_what_was_sent_once_and_comes_twice_is_a_duplicate_at_the_edges_too() -> None:
    settled = fates(
        *(event for n in (0, 9) for event in (sent(n, n * 1.0), received(n, n + 0.05), received(n, n + 0.06))),
        since_s=-0.02,
        silent=[(9.02, math.inf)],
    )
    assert counts(settled) == {Fate.ARRIVED: 2, Fate.DUPLICATE: 2}


def test_what_comes_again_long_after_its_sender_was_heard_is_no_duplicate() -> None:
    settled = fates(sent(1, 0.0), received(1, 0.01), received(1, 9.0), silent=[(0.5, math.inf)])
    assert counts(settled) == {Fate.ARRIVED: 1, Fate.STRANGE: 1}


def test_what_differs_has_its_delay_whatever_flowed_before() -> None:
    settled = fates(
        *(sent(n, n * 0.1) for n in range(9)), *(received(n, n * 0.1 + 0.05) for n in range(9)), since_s=0.0
    )
    assert not any(one.is_repeat for one in settled)


def test_two_copies_under_way_at_once_are_taken_in_their_order() -> None:
    """40 ms apart and 50 ms under way: neither is reordered."""
    settled = fates(sent("same", 0.0), sent("same", 0.04), received("same", 0.05), received("same", 0.09))
    assert [(one.copy, one.is_reordered) for one in settled] == [(0, False), (1, False)]


def test_only_so_many_pdus_are_remembered() -> None:
    matching = Matching(WAY, grace_s=0.1, remembered=10)
    for n in range(100):
        matching.sent(sent(n, n * 1.0))
        matching.received(received(n, n + 0.01))
        matching.settle(n + 1.0)
    matching.received(received(0, 200.0))
    matching.received(received(99, 200.1))
    assert [one.fate for one in matching.settle(math.inf)][-2:] == [Fate.STRANGE, Fate.DUPLICATE]


@st.composite
def journeys(draw: st.DrawFn) -> list[tuple[int, float, list[float]]]:
    """Messages: name, when sent, and after how long each of its copies arrives; none: it is lost."""
    delays = st.lists(st.floats(0.0, 0.9), max_size=3)
    return [(n, n * 0.05, draw(delays)) for n in range(draw(st.integers(0, 30)))]


@settings(deadline=None, max_examples=300)
@given(made=journeys(), skew_s=st.floats(-0.9, 0.9), has_clocks=st.booleans())
def test_what_was_made_is_what_is_measured(
    made: list[tuple[int, float, list[float]]], skew_s: float, has_clocks: bool
) -> None:
    """Loss, duplicates, order and delays of any journey, whoever's word is how much faster."""
    clock = Clock("boot") if has_clocks else NO_CLOCK
    arrivals = sorted((at + delay, n) for n, at, delays in made for delay in delays)
    settled = fates(
        *(sent(n, at, clock=clock, heard_s=at + max(0.0, skew_s)) for n, at, _ in made),
        *(received(n, at, clock=clock, heard_s=at + max(0.0, -skew_s)) for at, n in arrivals),
        grace_s=2.0,
    )
    expected = Counter(
        {
            Fate.ARRIVED: sum(bool(delays) for _, _, delays in made),
            Fate.LOST: sum(not delays for _, _, delays in made),
            Fate.DUPLICATE: sum(max(0, len(delays) - 1) for _, _, delays in made),
        }
    )
    assert counts(settled) == dict(+expected)
    firsts = list(dict.fromkeys(n for _, n in arrivals))
    assert sum(one.is_reordered for one in settled) == sum(
        any(later > n for later in firsts[:place]) for place, n in enumerate(firsts)
    )
    delays = {int(one.what.digest): one for pair in settled if (one := pair.sent) is not None and pair.received}
    assert set(delays) == {n for n, _, copies in made if copies}


@settings(deadline=None, max_examples=200)
@given(
    kept=st.lists(st.booleans(), max_size=60),
    delay_s=st.floats(0.0, 0.09),
)
def test_copies_of_one_pdu_are_counted_one_by_one(kept: list[bool], delay_s: float) -> None:
    """The same octets every 0.1 s, as the lab test sends them: any of them lost, delays below the period."""
    settled = fates(
        *(sent("same", n * 0.1) for n in range(len(kept))),
        *(received("same", n * 0.1 + delay_s) for n, is_kept in enumerate(kept) if is_kept),
    )
    arrived = sorted(one.copy for one in settled if one.fate is Fate.ARRIVED)
    lost = sorted(one.copy for one in settled if one.fate is Fate.LOST)
    assert arrived == [n for n, is_kept in enumerate(kept) if is_kept]
    assert lost == [n for n, is_kept in enumerate(kept) if not is_kept]


@settings(deadline=None, max_examples=200)
@given(events=st.lists(st.tuples(st.booleans(), st.integers(0, 4), st.floats(0, 30)), max_size=80))
def test_no_event_is_left_out_or_told_twice(events: list[tuple[bool, int, float]]) -> None:
    made = [sent(n, at) if is_sent else received(n, at) for is_sent, n, at in events]
    settled = fates(*made)
    # What is corrected was told before: of the one that was sent, or of the one that was received.
    told_sent = Counter(id(one.sent) for one in settled if one.sent is not None and one.was in (None, Fate.STRANGE))
    told_received = Counter(
        id(one.received) for one in settled if one.received is not None and one.was is not Fate.STRANGE
    )
    assert told_sent == Counter(id(one) for one in made if isinstance(one, Sent))
    assert told_received == Counter(id(one) for one in made if isinstance(one, ReceivedEvent))
