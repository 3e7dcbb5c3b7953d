"""Sequencer of a slot: switches that fail, and functions that the board file leaves out."""

import pytest

from board.description import SlotDescription
from board.runtime.errors import InterfaceError
from board.slot import SequencerState
from board.supply import ANSWER_S
from tests.board.slot_bench import DOWN, MODEM, UP, Bench, bench, bring
from tests.said import tells

__all__ = ["bench"]  # a fixture

# Switches that fail.

BROKEN = InterfaceError("gpiochip0, line 5: gone", "`gpioinfo` lists lines")


@pytest.mark.parametrize("step", UP)
def test_a_switch_that_fails_on_the_way_up_is_a_fault_with_its_words(bench, step):
    bench.failing[step] = BROKEN
    bench.slot.power()
    bench.until(SequencerState.FAULT)
    kind, on = step
    assert bench.slot.cause.message == f"{kind} {'on' if on else 'off'}: gpiochip0, line 5: gone"
    assert bench.slot.cause.hint == "`gpioinfo` lists lines"
    assert bench.take()[-1] == step


@pytest.mark.parametrize("step", DOWN)
def test_a_switch_that_fails_on_the_way_down_is_a_fault_that_no_device_ends(bench, step):
    bring(bench, SequencerState.PRESENT)
    bench.take()
    bench.failing[step] = BROKEN
    bench.slot.cut()
    assert (bench.slot.state, bench.take()) == (
        SequencerState.FAULT,
        DOWN,
    )  # a reset that cannot be held keeps no power on
    bench.slot.device_changed()
    bench.loop.run_for(60.0)
    assert bench.slot.state is SequencerState.FAULT


def test_the_first_cause_of_a_fault_is_kept_through_power_cycles(bench):
    bring(bench, SequencerState.FAULT)
    first = bench.slot.cause
    bench.failing["power", True] = BROKEN
    for again in (bench.slot.cycle, bench.slot.power):
        again()
        assert bench.slot.state is SequencerState.OFF
        bench.until(SequencerState.FAULT)
        assert bench.slot.cause is first
    bench.slot.cut()
    assert bench.slot.cause is None


def test_power_in_a_fault_is_a_power_cycle(bench):
    bring(bench, SequencerState.FAULT)
    bench.take()
    bench.slot.power()
    assert bench.until(SequencerState.POWERED) == pytest.approx(5.0)
    assert bench.take() == DOWN + UP[:2]


def test_a_switch_that_never_answers_is_a_fault(loop):
    bench = Bench(loop, is_prompt=False)
    bench.slot.power()
    assert bench.until(SequencerState.FAULT) == pytest.approx(ANSWER_S)
    assert bench.slot.cause.message == "reset on: timeout after 15 s"
    bench.answer()  # late
    bench.loop.run_for(60.0)
    assert (bench.slot.state, bench.take()) == (SequencerState.FAULT, [("reset", True)])


def test_switches_wait_for_each_other_and_answers_count_once(loop):
    bench = Bench(loop, is_prompt=False)
    bench.slot.power()
    assert bench.take() == [("reset", True)]
    first = bench.answer()
    assert bench.take() == [("power", True)]
    first(BROKEN)
    bench.answer()
    bench.loop.run_for(0.5)
    assert (bench.slot.state, bench.take()) == (SequencerState.POWERED, [("reset", False)])
    bench.answer()
    assert bench.slot.state is SequencerState.RELEASED


def test_off_s_begins_when_the_power_is_off(loop):
    bench = Bench(loop, is_prompt=False)
    bench.slot.cycle()
    for _ in DOWN:
        bench.loop.run_for(3.0)
        bench.answer()
    assert bench.until(SequencerState.POWERED) == pytest.approx(5.0)


def test_a_cut_does_not_wait_for_a_switch_that_is_on_its_way(loop):
    bench = Bench(loop, is_prompt=False)
    bench.slot.power()
    late = bench.waiting.pop()
    bench.slot.cut()
    late(BROKEN)
    assert bench.slot.state is SequencerState.OFF
    bench.answer()
    bench.answer()
    assert bench.take() == [("reset", True), *DOWN]


def test_who_is_told_of_a_change_may_ask_for_the_next(bench):
    bench.on_change = lambda slot: slot.cut() if slot.state is SequencerState.FAULT else None
    bench.failing["power", True] = BROKEN
    bench.slot.power()
    assert bench.slot.state is SequencerState.OFF
    assert bench.changes == [SequencerState.POWERED, SequencerState.FAULT, SequencerState.OFF]


# What the board file leaves out.


def test_a_hub_port_is_used_where_there_is_no_line(loop):
    bench = Bench(loop, SlotDescription(usb="1-1.3", hub_port=True))
    bench.slot.power()
    bench.slot.cut()
    assert bench.take() == [("hub_port", True), ("hub_port", False)]


def test_a_line_comes_before_a_hub_port(loop):
    bench = Bench(loop, SlotDescription(usb="1-1.3", hub_port=True, power="on"))
    bench.slot.power()
    assert bench.take() == [("power", True)]


def test_a_slot_without_a_switch_is_cut_by_taking_its_device_from_the_kernel(loop):
    bench = Bench(loop, SlotDescription(usb="1-1.3"))
    bring(bench, SequencerState.PRESENT)
    assert bench.take() == []
    bench.slot.cycle()
    assert bench.take() == [("authorize", False)]
    bench.found = MODEM._replace(is_authorized=False)
    bench.until(SequencerState.POWERED)
    assert bench.take() == [("authorize", True)]
    bench.found = MODEM
    bench.until(SequencerState.PRESENT)
    assert bench.slot.note == ""


def test_nothing_is_authorized_in_an_empty_slot(loop):
    bench = Bench(loop, SlotDescription(usb="1-1.3"))
    bench.slot.cycle()
    bench.until(SequencerState.RELEASED)
    assert bench.take() == []


def test_device_without_a_usb_path_is_taken_as_present_and_noted(loop):
    bench = Bench(loop, SlotDescription(power="gnss_power", settle_s=1.0))
    bench.slot.power()
    assert bench.until(SequencerState.PRESENT) == pytest.approx(1.0)
    assert tells(bench.slot.note, "no USB path")
    bench.slot.device_changed()
    bench.loop.run_for(60.0)
    assert (bench.slot.state, bench.slot.device) == (SequencerState.PRESENT, None)


def test_a_slot_of_which_nothing_is_known_switches_nothing(loop):
    bench = Bench(loop, SlotDescription())
    bench.slot.power()
    bench.until(SequencerState.PRESENT)
    bench.slot.cycle()
    bench.until(SequencerState.PRESENT)
    assert bench.take() == []
    assert bench.slot.status()["switched_by"].startswith("nothing")
