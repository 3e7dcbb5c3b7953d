"""Hours in virtual time for every fault: seconds that are passed on, and how well the time is known, beside the truth.

`make days` plays the whole days.
"""

from dataclasses import replace
from functools import cache

import pytest

from pps import timemark
from pps.chrony import feed
from pps.quality import Estimator
from pps.refused import Why
from tests.pps.days.__main__ import HEADS, Played, play, row
from tests.pps.days.account import HOLDOVER, PULSES, Account
from tests.pps.days.day import Day, Plan
from tests.pps.days.plans import AROUND_S, LOST_S, days, emulated, random_day
from tests.pps.days.trouble import Kind, Trouble

HOUR = 3_600
PLAYED_S = 3 * HOUR  # played of each day: most faults come every hour or two
# An engine starts after 5 hours, outages of minutes and some steps come later, and only two days are without pulses.
LONGER_S = 8 * HOUR
LONGER = ("engine and sun", "outages", "clock stepped", "messages alone", "the system's word")
NIGHT = (5 * HOUR, 13 * HOUR)  # played of a day with a special midnight, from noon on


def begun(plan: Plan) -> Plan:
    """Return the beginning of a day, or the hours around its special midnight, with the troubles that lie in them."""
    begin, end = NIGHT if plan.seconds == AROUND_S else (0, LONGER_S if plan.name in LONGER else PLAYED_S)
    troubles = (one._replace(at=one.at - begin) for one in plan.troubles if begin <= one.at and one.end < end)
    return replace(plan, start_s=plan.start_s + begin, seconds=end - begin, troubles=tuple(troubles))


def played(*troubles: Trouble, seconds: int = HOUR) -> Account:
    return Day(Plan("short", 1, troubles, base_ns=3_000.0, seconds=seconds)).play()


def unmet(account: Account) -> list[str]:
    return [goal.what.partition(":")[0] for goal in account.goals() if not goal.is_met]


DAYS = [begun(plan) for plan in days()]


@cache
def played_once(name: str) -> Played:
    return play(next(plan for plan in DAYS if plan.name == name))


@pytest.mark.parametrize("plan", DAYS, ids=lambda plan: plan.name)
def test_a_day_passes_on_no_wrong_second_is_back_within_5_s_and_knows_how_well_it_knows_the_time(plan):
    found = played_once(plan.name)
    print(f"\n{HEADS}\n{row(found)}")
    account = found.account
    assert [f"{goal.what}: {goal.seen}" for goal in account.goals_of_day() if not goal.is_met] == []
    assert account.known[HOLDOVER].inside_share >= 0.999
    lost = sum(trouble.seconds >= LOST_S for trouble in plan.troubles if trouble.kind is Kind.LOSS)
    assert account.acquired == (1 + lost if plan.is_wired else 0)


def test_over_all_boards_the_bound_is_not_wide():
    together = Account()
    for plan in DAYS:
        together.add(played_once(plan.name).account)
    assert [f"{goal.what}: {goal.seen}" for goal in together.goals() if not goal.is_met] == []
    assert all(len(told.errors) > 2_000 for told in together.told.values())
    assert together.fed > 15


def test_a_day_of_lateness_that_wanders_is_known_as_well():
    found = play(begun(emulated()))
    print(f"\n{HEADS}\n{row(found)}")
    assert [f"{goal.what}: {goal.seen}" for goal in found.account.goals_of_day() if not goal.is_met] == []
    assert found.account.known[PULSES].usual_bound_ns < 800_000
    assert found.account.known[HOLDOVER].usual_bound_ns < 5_000_000


def test_a_day_is_the_same_whenever_it_is_played():
    plan = replace(random_day(3), seconds=4 * HOUR)
    one, other = Day(plan).play(), Day(plan).play()
    assert one.all.errors == other.all.errors
    assert one.refused == other.refused


# What the account would show


def test_a_receiver_that_is_wrong_for_too_long_is_seen_to_be_believed():
    account = played(Trouble(600, 1_000, Kind.BOTH, 1.0))
    assert account.wrong > 100
    assert "wrong seconds passed on" in unmet(account)


def test_a_receiver_that_is_wrong_from_the_start_is_seen_to_be_believed():
    assert played(Trouble(0, 20, Kind.BOTH, -1.0), seconds=60).wrong > 10


def test_a_pairing_that_asks_for_too_much_is_seen_to_be_slow(monkeypatch):
    monkeypatch.setattr(timemark, "AGREEING", 8)
    assert played(Trouble(600, 100, Kind.LOSS)).back_s == 7


def test_good_pulses_that_are_refused_are_counted():
    day = Day(Plan("short", 1, seconds=900))
    day._pairing = timemark.Pairing(limit_ns=10)
    assert day.play().refused_good > 800


def test_samples_of_a_clock_that_was_stepped_since_are_seen(monkeypatch):
    monkeypatch.setattr(feed, "STEP_NS", 10**12)
    steps = tuple(Trouble(at, 1, Kind.STEP, 0.002) for at in range(100, 900, 20))
    assert played(*steps, seconds=900).misled > 5


def test_bounds_that_are_too_narrow_are_seen(monkeypatch):
    estimate = Estimator.estimate
    monkeypatch.setattr(
        Estimator, "estimate", lambda self, raw_ns: (found := estimate(self, raw_ns)) and (found[0], 2_000)
    )
    assert "truth inside the stated bound" in unmet(played())


def test_bounds_that_are_too_wide_are_seen(monkeypatch):
    estimate = Estimator.estimate
    monkeypatch.setattr(
        Estimator, "estimate", lambda self, raw_ns: (found := estimate(self, raw_ns)) and (found[0], 50_000)
    )
    assert any("median bound" in what for what in unmet(played()))


def test_an_estimate_that_is_off_by_a_second_is_seen(monkeypatch):
    estimate = Estimator.estimate
    monkeypatch.setattr(
        Estimator, "estimate", lambda self, raw_ns: (found := estimate(self, raw_ns)) and (found[0] + 10**9, found[1])
    )
    assert "truth inside the stated bound" in unmet(played())


# What the troubles do


@pytest.mark.parametrize(
    ("kind", "amount", "why"),
    [
        (Kind.NOISE, 1.0, Why.OFF_GRID),
        (Kind.BOUNCE, 0.0, Why.DUPLICATE),
        (Kind.TRAILING, 0.0, Why.OFF_GRID),
        (Kind.RESTART, 0.0, Why.UNLOCKED),
        (Kind.VAGUE, 1_001.0, Why.ANNOUNCED_BADLY),
        (Kind.MARK, 1.0, Why.OTHER_SECOND),
        (Kind.EPOCH, 1.0, Why.DISAGREE),
        (Kind.BOTH, 1.0, Why.OTHER_SECOND),
        (Kind.LATE, 9.0, Why.UNANNOUNCED),
    ],
)
def test_a_trouble_is_met_with_its_reason(kind, amount, why):
    account = played(Trouble(600, 40, kind, amount), seconds=900)
    assert account.refused[why] > 10
    assert account.wrong == account.refused_good == 0


@pytest.mark.parametrize("kind", [Kind.LOSS, Kind.MISSED])
def test_without_pulses_the_oscillator_holds_the_time(kind):
    account = played(Trouble(600, 1_200, kind, 1.0), seconds=2_400)
    assert len(account.known[HOLDOVER].errors) >= 115
    assert account.known[HOLDOVER].usual_error_ns > account.known[PULSES].usual_error_ns


def test_a_stall_is_caught_up_with():
    account = played(Trouble(600, 20, Kind.STALL), seconds=900)
    assert account.passed >= 900 - 8
    assert account.wrong == 0
