"""The sequencer of a slot: every cell of its table, its switches, and what its device may do."""

import pytest

from board.description import SlotDescription
from board.presence import FLAP_S, FLAPS
from board.runtime.errors import InterfaceError
from board.slot import STEADY_S, TABLE, Event, SequencerState, SlotSequencer
from board.supply import ANSWER_S
from board.usb import UsbDevice

FULL = SlotDescription(
    title="5G",
    usb="1-1.3",
    ids=("1e0e:9001",),
    power="5g_power",
    reset="5g_reset",
    settle_s=0.5,
    wait_s=20.0,
    off_s=5.0,
)
MODEM = UsbDevice("1-1.3", 7, "1e0e", "9001", "SimTech", "SDXPRAIRIE-MTP")
OTHER = UsbDevice("1-1.3", 9, "1546", "01a9", "u-blox AG", "u-blox GNSS receiver")


class Bench:
    """A slot whose switches are a list and whose device is a variable; answers come at once, or when answer() is called."""

    def __init__(self, loop, description=FULL, is_prompt=True):
        self.loop = loop
        self.found = None
        self.switched = []
        self.waiting = []
        self.failing = {}
        self.is_prompt = is_prompt
        self.changes = []
        self.slot = SlotSequencer(loop, "3", description, self.switch, lambda: self.found, self.changed)
        self.on_change = lambda slot: None

    def switch(self, kind, on, done):
        assert not self.waiting, "one at a time"
        self.switched.append((kind, on))
        if self.is_prompt:
            done(self.failing.get((kind, on)))
        else:
            self.waiting.append(done)

    def answer(self, error=None):
        done = self.waiting.pop()
        done(error)
        return done

    def changed(self, slot):
        self.changes.append(slot.state)
        self.on_change(slot)

    def plug(self, device=MODEM):
        self.found = device
        self.slot.device_changed()

    def unplug(self):
        self.plug(None)

    def take(self):
        """What was switched since the last call."""
        taken, self.switched = self.switched, []
        return taken

    def until(self, state, within=60.0):
        start = self.loop.now
        self.loop.run_until(lambda: self.slot.state is state, within)
        return self.loop.now - start


@pytest.fixture
def bench(loop):
    return Bench(loop)


UP = [("reset", True), ("power", True), ("reset", False)]
DOWN = [("reset", True), ("power", False)]


def bring(bench, state):
    """Into a state by what happens on the way there."""
    if state is SequencerState.OFF:
        return
    bench.slot.power()
    if state is not SequencerState.POWERED:
        bench.until(SequencerState.RELEASED)
    if state is SequencerState.PRESENT:
        bench.plug()
    if state is SequencerState.FAULT:
        bench.until(SequencerState.FAULT)
    assert bench.slot.state is state


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


def test_the_time_line_says_when_and_why_each_state_began(bench):
    start = bench.loop.now
    bench.slot.power()
    bench.loop.run_for(8.5)
    bench.plug()
    assert [(passage.state, passage.began_s - start, passage.why) for passage in bench.slot.timeline] == [
        (SequencerState.OFF, 0.0, "as it was found"),
        (SequencerState.POWERED, 0.0, "power-on requested, and off_s has passed since the last power-off"),
        (SequencerState.RELEASED, 0.5, "settle_s has passed since power-on; reset is released"),
        (SequencerState.PRESENT, 8.5, "1e0e:9001 (SimTech SDXPRAIRIE-MTP)"),
    ]


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
    for number in range(20):  # on and on: no change is told any more
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


def test_a_device_that_stays_while_its_slot_is_cut_is_noted(bench):
    bring(bench, SequencerState.PRESENT)
    bench.slot.cycle()
    bench.until(SequencerState.PRESENT)
    assert bench.slot.note == "its device stayed present while the power was off; switched by its power line"
    bench.found = None
    bench.slot.cycle()
    bench.until(SequencerState.RELEASED)
    assert bench.slot.note == ""


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


def test_a_device_without_a_known_place_is_taken_to_be_there_and_that_is_said(loop):
    bench = Bench(loop, SlotDescription(power="gnss_power", settle_s=1.0))
    bench.slot.power()
    assert bench.until(SequencerState.PRESENT) == pytest.approx(1.0)
    assert "the board file gives no USB path" in bench.slot.note
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
