"""Plan of cuts in an update, from the writes of a whole one."""

from pathlib import Path
from typing import Any

import pytest

from tests.proof.image import update_cuts
from tests.proof.image.medium import Fate
from tests.proof.image.update_cuts import COUNTERS, FETCH, SLOT, Cut, Seen, plan

WRITES = {"data": 400, "root-b": 1500, "state": 4}


@pytest.mark.parametrize("count", [1, 2, 12, 40])
def test_the_plan_is_always_the_same_and_within_what_is_written(count: int):
    planned = plan(count, WRITES)
    assert planned == plan(count, WRITES)
    assert len(planned) == count
    assert all(1 <= cut.write <= WRITES[cut.where.partition] for cut in planned)


def test_every_write_of_the_counters_is_met():
    cuts = [cut for cut in plan(12, WRITES) if cut.where is COUNTERS]
    assert {cut.write for cut in cuts} == {1, 2, 3, 4}


def test_of_twelve_cuts_each_place_and_each_fate_has_some():
    planned = plan(12, WRITES)
    assert {cut.where for cut in planned} == {COUNTERS, SLOT, FETCH}
    assert {cut.fate for cut in planned} == set(Fate)
    assert {cut.where for cut in planned if cut.is_full} == {COUNTERS, SLOT, FETCH}


def test_the_short_form_cuts_the_slot_and_the_counters():
    assert [cut.where for cut in plan(2, WRITES)] == [SLOT, COUNTERS]


def _seen(monkeypatch: pytest.MonkeyPatch, write: int, comes: int) -> Seen:
    """Of a cut that is planned for a write of the slot, where so many come."""

    def is_met(*words: Any) -> bool:
        return words[4].write <= comes

    monkeypatch.setattr(update_cuts, "_is_met", is_met)
    monkeypatch.setattr(update_cuts, "_after", lambda *_: Seen("A", "A whole", True))
    nobody: Any = None
    return update_cuts._cut(nobody, Path(), nobody, "", Cut(SLOT, write, Fate.DROP, False), 0, nobody)


def test_a_cut_that_is_not_met_comes_at_an_earlier_write_and_says_so(monkeypatch: pytest.MonkeyPatch):
    assert _seen(monkeypatch, 324, comes=400) == Seen("A", "A whole", True)
    assert _seen(monkeypatch, 324, comes=300) == Seen("A", "at 243, as no 324 came: A whole", True)
    assert _seen(monkeypatch, 5, comes=4) == Seen("A", "at 4, as no 5 came: A whole", True)


def test_a_cut_that_is_never_met_is_no_start_after_one(monkeypatch: pytest.MonkeyPatch):
    assert _seen(monkeypatch, 324, comes=0) == Seen("-", "is not met: nothing was written there", False)
