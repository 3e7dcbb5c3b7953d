"""Sequencer of a slot: the device that it waits for, and the faults of a device."""

import pytest

from board.description import SlotDescription
from board.presence import FLAP_S, FLAPS
from board.slot import STEADY_S, SequencerState
from board.usb import UsbDevice
from tests.board.slot_bench import MODEM, OTHER, Bench, bench, bring
from tests.said import tells

__all__ = ["bench"]  # a fixture

# The device.


def test_a_device_that_does_not_come_is_a_fault_that_names_its_place(bench):
    bring(bench, SequencerState.RELEASED)
    assert bench.until(SequencerState.FAULT) == pytest.approx(20.0)
    assert bench.slot.cause.message == "no USB device at 1-1.3 within 20 s"
    assert bench.slot.cause.hint


def test_a_wrong_device_is_a_fault_of_its_own(bench):
    bring(bench, SequencerState.RELEASED)
    bench.plug(OTHER)
    assert bench.until(SequencerState.FAULT) == pytest.approx(20.0)
    assert bench.slot.cause.message == (
        "wrong device at 1-1.3: 1546:01a9 (u-blox AG u-blox GNSS receiver), expected 1e0e:9001"
    )


def test_a_device_that_the_kernel_did_not_tell_of_is_found_when_its_time_is_over(bench):
    bring(bench, SequencerState.RELEASED)
    bench.found = MODEM
    assert bench.until(SequencerState.PRESENT) == pytest.approx(20.0)


def test_a_boot_loader_that_comes_first_is_no_fault(bench):
    bring(bench, SequencerState.RELEASED)
    bench.plug(UsbDevice("1-1.3", 6, "05c6", "9008"))
    bench.loop.run_for(5.0)
    bench.plug(MODEM)
    assert bench.slot.state is SequencerState.PRESENT


def test_a_device_that_is_not_authorized_is_not_there(bench):
    bring(bench, SequencerState.RELEASED)
    bench.plug(MODEM._replace(is_authorized=False))
    bench.until(SequencerState.FAULT)
    assert bench.slot.cause.message == "1e0e:9001 (SimTech SDXPRAIRIE-MTP) at 1-1.3 is not authorized"


def test_a_slot_without_ids_takes_anything(loop):
    bench = Bench(loop, SlotDescription(usb="1-1.3"))
    bring(bench, SequencerState.RELEASED)
    bench.plug(OTHER)
    assert (bench.slot.state, bench.slot.device) == (SequencerState.PRESENT, OTHER)


def test_a_device_that_goes_is_waited_for_again(bench):
    bring(bench, SequencerState.PRESENT)
    bench.unplug()
    assert (bench.slot.state, bench.slot.device) == (SequencerState.RELEASED, None)
    bench.loop.run_for(19.9)
    bench.plug()
    assert bench.slot.state is SequencerState.PRESENT
    bench.unplug()
    assert bench.until(SequencerState.FAULT) == pytest.approx(20.0)


def test_a_device_that_went_and_came_unseen_is_told_as_both(bench):
    bring(bench, SequencerState.PRESENT)
    bench.changes.clear()
    bench.plug(MODEM._replace(number=8))
    assert bench.changes == [SequencerState.RELEASED, SequencerState.PRESENT]
    assert bench.slot.device.number == 8


def test_uevents_without_a_change_change_nothing(bench):
    for state in (SequencerState.OFF, SequencerState.POWERED, SequencerState.RELEASED):
        assert bench.slot.state is state
        for _ in range(3):
            bench.slot.device_changed()
        bench.slot.power() if state is SequencerState.OFF else bench.until(SequencerState.RELEASED)
    bench.plug()
    bench.changes.clear()
    for _ in range(3):
        bench.slot.device_changed()
    assert bench.changes == []


def test_a_device_that_flaps_is_a_fault_until_it_stays(bench):
    bring(bench, SequencerState.PRESENT)
    for number in range(FLAPS):
        bench.unplug()
        bench.loop.run_for(1.0)
        bench.plug(MODEM._replace(number=10 + number))
    assert bench.slot.state is SequencerState.FAULT
    assert bench.slot.cause.message == f"its device at 1-1.3 disappeared {FLAPS} times within 60 s"
    for number in range(20):  # no further change is reported
        bench.changes.clear()
        bench.unplug()
        bench.loop.run_for(STEADY_S / 2)
        bench.plug(MODEM._replace(number=20 + number))
        bench.loop.run_for(STEADY_S / 2)
        assert bench.changes == []
    assert bench.until(SequencerState.PRESENT) == pytest.approx(STEADY_S / 2)
    assert bench.slot.cause is None


def test_a_device_that_goes_now_and_then_does_not_flap(bench):
    bring(bench, SequencerState.PRESENT)
    for _ in range(3 * FLAPS):
        bench.unplug()
        bench.plug()
        bench.loop.run_for(FLAP_S / (FLAPS - 1) + 0.1)
    assert bench.slot.state is SequencerState.PRESENT
    assert bench.slot.status()["losses"] == 3 * FLAPS


def test_a_fault_ends_when_its_device_is_plugged_in_and_stays(bench):
    bring(bench, SequencerState.FAULT)
    bench.plug()
    assert bench.slot.state is SequencerState.FAULT
    bench.loop.run_for(STEADY_S / 2)
    bench.slot.device_changed()  # its interfaces come one by one
    assert bench.until(SequencerState.PRESENT) == pytest.approx(STEADY_S / 2)
    assert (bench.slot.device, bench.slot.cause) == (MODEM, None)


def test_a_fault_does_not_end_with_a_wrong_device(bench):
    bring(bench, SequencerState.FAULT)
    bench.plug(OTHER)
    bench.loop.run_for(60.0)
    assert bench.slot.state is SequencerState.FAULT


def test_device_that_stays_while_its_slot_is_cut_is_noted(bench):
    bring(bench, SequencerState.PRESENT)
    bench.slot.cycle()
    bench.until(SequencerState.PRESENT)
    assert tells(bench.slot.note, "device", "present", "power was off", "power line")
    bench.found = None
    bench.slot.cycle()
    bench.until(SequencerState.RELEASED)
    assert bench.slot.note == ""
