"""Sequencer of a slot: the way up and down, every cell of its table, its status."""

import pytest

from board.slot import TABLE, Event, SequencerState
from tests.board.slot_bench import DOWN, MODEM, UP, bench, bring
from tests.said import tells

__all__ = ["bench"]  # a fixture

# The way up and down.


def test_a_slot_comes_up_in_order_and_in_its_time(bench):
    bench.slot.power()
    assert (bench.slot.state, bench.take()) == (SequencerState.POWERED, UP[:2])
    assert bench.until(SequencerState.RELEASED) == pytest.approx(0.5)
    assert bench.take() == UP[2:]
    bench.loop.run_for(8.0)
    bench.plug()
    assert (bench.slot.state, bench.slot.device) == (SequencerState.PRESENT, MODEM)
    assert bench.changes == [SequencerState.POWERED, SequencerState.RELEASED, SequencerState.PRESENT]


def test_time_line_of_a_slot_has_the_time_and_reason_of_each_state(bench):
    start = bench.loop.now
    bench.slot.power()
    bench.loop.run_for(8.5)
    bench.plug()
    assert [(passage.state, passage.began_s - start) for passage in bench.slot.timeline] == [
        (SequencerState.OFF, 0.0),
        (SequencerState.POWERED, 0.0),
        (SequencerState.RELEASED, 0.5),
        (SequencerState.PRESENT, 8.5),
    ]
    off, powered, released, present = (passage.why for passage in bench.slot.timeline)
    assert "found" in off
    assert tells(powered, "power-on requested", "off_s")
    assert tells(released, "settle_s", "reset")
    assert present == "1e0e:9001 (SimTech SDXPRAIRIE-MTP)"


def test_a_slot_goes_down_in_order_and_tells_when_it_has_been_off_for_long_enough(bench):
    bring(bench, SequencerState.PRESENT)
    bench.take()
    bench.slot.cut()
    assert (bench.slot.state, bench.take(), bench.slot.is_off_time_over) == (SequencerState.OFF, DOWN, False)
    bench.changes.clear()
    bench.loop.run_for(4.9)
    assert bench.changes == []
    bench.loop.run_for(0.1)
    assert (bench.changes, bench.slot.is_off_time_over) == ([SequencerState.OFF], True)


def test_power_that_is_asked_for_too_early_comes_when_off_s_is_over(bench):
    bring(bench, SequencerState.PRESENT)
    bench.slot.cut()
    bench.slot.power()
    bench.take()
    assert bench.until(SequencerState.POWERED) == pytest.approx(5.0)
    assert bench.take() == UP[:2]


def test_a_cycle_is_a_cut_and_power_after_off_s(bench):
    bring(bench, SequencerState.PRESENT)
    bench.take()
    bench.slot.cycle()
    assert bench.until(SequencerState.POWERED) == pytest.approx(5.0)
    assert bench.take() == DOWN + UP[:2]


def test_power_asked_for_and_taken_back_stays_off(bench):
    bench.slot.cycle()
    bench.slot.cut()
    bench.loop.run_for(60.0)
    assert bench.slot.state is SequencerState.OFF
    assert ("power", True) not in bench.take()


def test_a_module_that_runs_when_the_station_starts_is_not_reset(bench):
    bench.found = MODEM
    bench.slot.power()
    assert bench.until(SequencerState.PRESENT) == pytest.approx(0.5)
    assert bench.take() == [("power", True), ("reset", False)]


# The table.


@pytest.mark.parametrize("state", SequencerState)
@pytest.mark.parametrize("event", Event)
def test_each_cell_of_the_table_leads_where_it_says(bench, state, event):
    bring(bench, state)
    bench.changes.clear()
    bench.is_prompt = False  # what follows by itself, follows later
    bench.found = MODEM if event in (Event.SEEN, Event.STEADY) else None
    bench.slot._enqueue(event, "a reason")
    rule = TABLE.get((state, event))
    follows = rule.state if rule else state
    if (state, event) == (SequencerState.OFF, Event.POWER):
        follows = SequencerState.POWERED  # by READY, which comes at once: nothing was cut
    assert bench.slot.state is follows
    assert bench.changes == ([] if follows is state else [follows])


@pytest.mark.parametrize("state", SequencerState)
def test_cut_leads_to_off_from_everywhere_and_nothing_comes_after(bench, state):
    bring(bench, state)
    bench.take()
    bench.slot.cut()
    bench.found = MODEM
    bench.slot.device_changed()
    bench.loop.run_for(300.0)
    assert (bench.slot.state, bench.take(), bench.slot.cause) == (SequencerState.OFF, DOWN, None)


@pytest.mark.parametrize("state", [SequencerState.POWERED, SequencerState.RELEASED, SequencerState.PRESENT])
def test_power_is_not_switched_twice(bench, state):
    bring(bench, state)
    bench.take()
    bench.slot.power()
    assert (bench.slot.state, bench.take()) == (state, [])


def test_what_the_readme_draws_is_in_the_table():
    drawn = {
        (SequencerState.OFF, SequencerState.POWERED),
        (SequencerState.POWERED, SequencerState.RELEASED),
        (SequencerState.RELEASED, SequencerState.PRESENT),
        (SequencerState.RELEASED, SequencerState.FAULT),
        (SequencerState.PRESENT, SequencerState.RELEASED),
        *((state, SequencerState.OFF) for state in SequencerState),
    }
    assert drawn <= {(state, rule.state) for (state, _), rule in TABLE.items()}


def test_the_status_says_what_an_operator_needs(bench):
    bring(bench, SequencerState.PRESENT)
    bench.loop.run_for(10.0)
    assert bench.slot.status() == {
        "title": "5G",
        "state": "present",
        "for_s": 10.0,
        "why": "1e0e:9001 (SimTech SDXPRAIRIE-MTP)",
        "cause": "",
        "hint": "",
        "note": "",
        "usb": "1-1.3",
        "device": "1e0e:9001 (SimTech SDXPRAIRIE-MTP)",
        "switched_by": "its power line",
        "losses": 0,
    }
