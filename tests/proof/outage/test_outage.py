"""The outages of an hour of a vehicle's network, and what takes part in that: its pattern, its accounts, its model."""

import itertools
import logging
from collections import Counter

import pytest

from drivers.mqtt.options import IN_FLIGHT
from drivers.reason import Reason
from tests.proof.outage import messages, pattern, result
from tests.proof.outage.account import KEEP_S, Account
from tests.proof.outage.messages import Schedule
from tests.proof.outage.pattern import Kind, Trouble
from tests.proof.outage.stage import TILED, Route
from tests.proof.outage.virtual import VirtualRun
from tests.proof.outage.watch import Watch
from tests.proof.outage.watch import goals as back_goals

HOUR_S = 3600.0
ROUTES = (Route("qos0", qos=0), Route("orange-kept", profile=TILED, is_kept=True))
SEED = 25  # its first hour has each kind of trouble


def test_an_hour_of_outages_loses_nothing_that_could_have_left(monkeypatch: pytest.MonkeyPatch) -> None:
    # Its quiet stretches are cut out; `make outages` plays all of 24 hours.
    monkeypatch.setattr(logging.getLogger("captain"), "level", logging.CRITICAL)
    troubles = pattern.squeezed(pattern.day(SEED, HOUR_S))
    assert {one.kind for one in troubles} == set(Kind)
    run = VirtualRun(SEED, troubles, monkeypatch, ROUTES, burst_s=120.0, denm_s=2.0)
    try:
        goals = run.play()
    finally:
        run.stage.stop()
    assert [f"{goal.what}: {goal.seen}" for goal in goals if not goal.is_met] == []
    outcomes = run.stage.paths["orange-kept"].account.sums.outcomes
    assert {Reason.EXPIRED, Reason.LINK_DOWN, Reason.QUEUE_FULL} <= set(outcomes)


# The pattern.


@pytest.mark.parametrize("seed", range(1, 6))
def test_half_an_hour_without_the_quiet_has_two_hundred_outages_of_up_to_20_s(seed: int) -> None:
    part = pattern.cut(pattern.day(seed), 1800.0)
    assert sum(one.is_outage for one in part) >= 200
    assert part[-1].end_s <= 1800.0


def test_a_cut_of_half_a_minute_has_one_outage_of_each_kind() -> None:
    part = pattern.cut(pattern.day(1), 30.0)
    assert {Kind.TUNNEL, Kind.HANDOVER, Kind.LOSS} == {one.kind for one in part}


def test_a_day_is_the_same_for_the_same_seed_and_its_troubles_keep_apart() -> None:
    day = pattern.day(1)
    assert day == pattern.day(1) != pattern.day(2)
    assert all(before.end_s + pattern.APART_S <= after.at_s for before, after in itertools.pairwise(day))
    kinds = Counter(one.kind for one in day)
    assert min(kinds[kind] for kind in Kind) >= 3
    assert day[-1].end_s < pattern.DAY_S


# What is accounted for.


def account(is_usable: bool = False, is_lossy: bool = False) -> Account:
    made = Account("one", 4.0, 1.0, lambda begin, end, need_s: is_usable, is_lossy)
    made.request(7, 100.0, 101.0, 0.5)
    return made


def test_what_arrived_and_was_said_to_be_sent_is_no_offence() -> None:
    one = account(is_usable=True)
    one.arrived(7, 100.1)
    one.said(7, None, 100.2)
    one.close_old(float("inf"))
    assert not one.offences
    assert (one.sums.outcomes, one.sums.arrived, one.length) == ({"": 1}, 1, 0)


def test_what_arrives_twice_is_a_repeat_and_no_offence() -> None:
    one = account()
    one.arrived(7, 100.1)
    one.arrived(7, 100.9)
    one.said(7, None, 100.9)
    one.close_old(float("inf"))
    assert (one.sums.repeats, one.offences) == (1, {})


@pytest.mark.parametrize(
    ("connections", "is_lossy", "offences"),
    [
        ((1,), True, set()),
        ((1, 2), False, set()),
        ((1, 1), False, {"left twice by one connection, or by QoS 0"}),
        ((1, 2), True, {"left twice by one connection, or by QoS 0"}),
    ],
)
def test_what_leaves_again_was_in_flight_when_a_connection_was_lost(
    connections: tuple[int, ...], is_lossy: bool, offences: set[str]
) -> None:
    one = account(is_lossy=is_lossy)
    for connection in connections:
        one.left(7, connection, 100.5)
    assert set(one.offences) == offences


def test_nothing_leaves_after_its_deadline_nor_after_its_outcome() -> None:
    one = account()
    one.left(7, 1, 101.0)
    assert not one.offences
    one.said(7, Reason.EXPIRED, 101.0)
    one.left(7, 2, 101.001)
    assert set(one.offences) == {"left after its lifetime", "left after its outcome was told"}


@pytest.mark.parametrize(("is_lossy", "offences"), [(False, set()), (True, {"said to be dropped, and arrived"})])
def test_what_was_dropped_arrives_only_where_an_acknowledgement_is_waited_for(
    is_lossy: bool, offences: set[str]
) -> None:
    one = account(is_lossy=is_lossy)
    one.arrived(7, 100.9)
    one.said(7, Reason.EXPIRED, 101.0)
    one.close_old(float("inf"))
    assert (set(one.offences), one.sums.dropped_yet_arrived) == (offences, 1)


def test_what_was_dropped_and_arrived_while_the_path_worked_should_have_been_acknowledged() -> None:
    one = account(is_usable=True)
    one.arrived(7, 100.9)
    one.said(7, Reason.EXPIRED, 101.0)
    assert set(one.offences) == {"dropped although its acknowledgement could have come"}


@pytest.mark.parametrize(
    ("is_lossy", "repeats", "is_met"), [(False, IN_FLIGHT, True), (False, IN_FLIGHT + 1, False), (True, 1, False)]
)
def test_repeats_are_bounded_by_what_was_in_flight(is_lossy: bool, repeats: int, is_met: bool) -> None:
    one = account(is_lossy=is_lossy)
    one.sums.repeats = repeats
    assert result.goals(one, 0, connections=2)[-1].is_met is is_met


@pytest.mark.parametrize("late_s", [4.1, KEEP_S + 2.0])
def test_what_arrives_late_is_stale(late_s: float) -> None:
    one = account()
    one.said(7, Reason.EXPIRED, 101.1)
    one.close_old(101.0 + late_s)
    one.arrived(7, 101.0 + late_s)
    assert sum(count for what, count in one.offences.items() if what.startswith("stale")) == 1


@pytest.mark.parametrize(
    ("reason", "at", "is_full", "offence"),
    [
        (Reason.EXPIRED, 100.9, True, "dropped for its age before its time"),
        (Reason.LINK_DOWN, 102.1, True, "dropped for its age and told late"),
        (Reason.SEND_FAILED, 100.5, True, "dropped for a reason that no outage explains"),
        (Reason.QUEUE_FULL, 100.5, False, "dropped by a queue with room"),
        (None, 105.1, True, "said to be sent after its lifetime"),
    ],
)
def test_a_word_that_is_wrong_is_an_offence(reason: Reason | None, at: float, is_full: bool, offence: str) -> None:
    one = account()
    one.said(7, reason, at, is_full)
    assert offence in one.offences


def test_a_message_that_could_have_left_must_not_expire() -> None:
    one = account(is_usable=True)
    one.said(7, Reason.EXPIRED, 101.1)
    assert "lost although it could have left" in one.offences


def test_a_message_of_which_nothing_is_said_or_too_much_is_an_offence() -> None:
    one = account()
    one.said(8, None, 100.0)
    one.close_old(float("inf"))
    assert set(one.offences) == {"said twice, or of no request", "nothing was said of it"}


@pytest.mark.parametrize(
    ("is_lossy", "is_usable", "is_offence"), [(False, False, True), (True, False, False), (True, True, True)]
)
def test_sent_in_vain_is_what_quality_of_service_0_may_be_amid_an_outage(
    is_lossy: bool, is_usable: bool, is_offence: bool
) -> None:
    one = account(is_usable, is_lossy)
    one.said(7, None, 100.1)
    one.close_old(float("inf"))
    assert bool(one.offences) is is_offence
    assert one.sums.sent_in_vain == 1


def test_a_path_works_from_the_first_message_that_is_through_to_the_next_trouble() -> None:
    watch = Watch()
    watch.through(10.0, 9.9)
    watch.begin(20.0)
    watch.through(20.1, 19.9)  # it was under way
    watch.end(Trouble(20.0, Kind.TUNNEL, 5.0), 25.0)
    watch.through(25.5, 24.9)
    watch.through(26.0, 25.1)
    assert watch.back_s[Kind.TUNNEL] == [1.0]
    spans = [(9.0, 10.4), (9.0, 10.6), (19.6, 26.0), (20.0, 26.4), (20.0, 26.6)]
    assert [watch.was_usable(*span, 0.5) for span in spans] == [False, True, False, False, True]


@pytest.mark.parametrize(
    ("kind", "back_s", "told", "is_met"),
    [
        (Kind.TUNNEL, 19.9, frozenset(), True),
        (Kind.TUNNEL, 20.1, frozenset(), False),
        (Kind.ABSENCE, 44.0, frozenset(), True),
        (Kind.HANDOVER, 1.1, frozenset({Kind.HANDOVER}), False),
    ],
)
def test_a_path_that_is_back_too_late_is_told(kind: Kind, back_s: float, told: frozenset[Kind], is_met: bool) -> None:
    watch = Watch()
    watch.begin(0.0)
    watch.end(Trouble(0.0, kind, 5.0), 5.0)
    watch.through(5.0 + back_s, 5.0)
    assert [goal.is_met for goal in back_goals("one", watch, told)] == [is_met, True]


def test_a_path_that_is_not_back_before_the_next_trouble_again_and_again_is_told() -> None:
    watch = Watch()
    for _ in range(3):
        watch.begin(0.0)
        watch.end(Trouble(0.0, Kind.TUNNEL, 5.0), 5.0)
    assert [goal.is_met for goal in back_goals("one", watch)] == [True, False]


# What is sent.


def test_a_number_is_found_again_in_its_pdu() -> None:
    for envelope in messages.NUMBERS:
        octets = messages.pdu(envelope, 123_456)
        assert messages.number_of(octets) == 123_456
        assert len(octets) == (43 if envelope == messages.DENM else messages.SIZE)
        assert messages.need_s(octets) == messages.NEED_S[envelope]


def test_a_burst_is_more_than_a_queue_holds() -> None:
    schedule = Schedule(1, burst_s=10.0)
    due = [one for _ in range(1000) for one in schedule.due()]
    assert max(one.count for one in due) > 256
    assert sum(one.envelope == messages.CAM for one in due) == 1000
