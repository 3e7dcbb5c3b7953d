"""Where an update is cut, as planned from what a whole one writes."""

import pytest

from tests.image.medium import Fate
from tests.image.update_cuts import COUNTERS, FETCH, SLOT, plan

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
