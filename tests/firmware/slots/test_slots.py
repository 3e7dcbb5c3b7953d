"""A slot's life in virtual time: every state, every way out of it, and hours of modules that fail at random."""

import logging
import random
from collections import Counter
from collections.abc import Callable

import pytest

from board.runtime.errors import BlockedError, InterfaceError, StuckError
from board.runtime.journal import DECISIONS
from drivers.contract import Host
from firmware.slots.states import FAULTS, Event, SlotState
from firmware.slots.supervisor import CYCLES, RULES, STARTS, STEADY_S
from tests.firmware.slots.bench import BOOT_S, DEAF, OFF_S, SETTLE_S, WAIT_S, Bench
from tests.said import tells
from tests.virtual import VirtualLoop


@pytest.fixture
def faulty(bench: Bench) -> Bench:
    """In a fault, its driver mended only now."""
    bench.break_driver()
    bench.until(SlotState.FAULT)
    bench.mend_driver()
    return bench


def lines(caplog: pytest.LogCaptureFixture, level: int) -> list[str]:
    return [r.getMessage() for r in caplog.records if r.name == "captain.slots" and r.levelno == level]


def test_before_the_start_nothing_is_switched_and_nothing_happens(loop: VirtualLoop) -> None:
    bench = Bench(loop)
    bench.slot.dispatch(Event.PLUGGED)
    assert (bench.state, bench.power.switched, bench.driver.starts) == (SlotState.STOPPED, [], 0)


def test_start_of_a_slot_powers_it_then_waits_for_its_device_then_starts_the_driver(bench: Bench) -> None:
    assert (bench.state, bench.power.is_on, bench.driver.starts) == (SlotState.POWERING, True, 0)
    bench.loop.run_for(BOOT_S)
    assert (bench.state, bench.driver.starts) == (SlotState.RUNNING, 1)
    powering, starting, running = bench.notes
    assert tells(powering, "powering: ", "started; ", "device at 1-1.3")
    assert starting == "starting: 1e0e:9001"
    assert tells(running, "running: ", "driver started")


def test_a_driver_that_fails_is_started_again_without_touching_power(running: Bench) -> None:
    running.interface.fail(DEAF)
    assert running.state is SlotState.STARTING
    running.loop.run_for(1)
    assert (running.state, running.driver.starts, running.power.cuts) == (SlotState.RUNNING, 2, 0)
    assert running.slot.status()["cause"] == DEAF.message


def test_a_driver_that_cannot_start_is_tried_often_before_power_is_cut(bench: Bench) -> None:
    bench.break_driver()
    bench.until(SlotState.CYCLING)
    assert (bench.driver.starts, bench.power.cuts) == (STARTS, 1)
    assert bench.loop.now - 1000 - BOOT_S > 45  # a radio needs 30 s until it answers


def test_a_driver_that_fails_again_and_again_costs_a_power_cycle_as_well(bench: Bench) -> None:
    bench.driver.on_start = lambda host: bench.loop.after(2.0, lambda: host.fail(DEAF)) and None
    bench.until(SlotState.CYCLING)
    assert bench.driver.starts == STARTS


def test_a_power_cycle_keeps_the_slot_without_power_for_a_while(bench: Bench) -> None:
    bench.break_driver()
    bench.until(SlotState.CYCLING)
    bench.mend_driver()
    bench.until(SlotState.RUNNING)
    (_, is_on), (off, is_off), (on, is_on_again) = bench.power.switched
    assert (is_on, is_off, is_on_again) == (True, False, True)
    assert on - off == pytest.approx(OFF_S)


@pytest.mark.parametrize("runs_first", [True, False])
def test_what_stands_in_the_drivers_way_costs_no_power_cycle_and_is_tried_for_ever(
    bench: Bench, runs_first: bool
) -> None:
    if runs_first:
        bench.until(SlotState.RUNNING)
    bench.break_driver(BlockedError("/dev/ttyUSB2 is in use by another program"))
    if runs_first:
        bench.interface.fail(DEAF)
    bench.until(SlotState.STARTING)
    bench.loop.run_for(3600)
    assert (bench.state, bench.power.cuts) == (SlotState.STARTING, 0)
    assert bench.driver.starts > 600
    bench.mend_driver()
    bench.until(SlotState.RUNNING, within=10)


def test_a_driver_that_says_its_module_is_stuck_gets_a_power_cycle_at_once(running: Bench) -> None:
    running.interface.fail(StuckError("the modem answers nothing"))
    assert (running.state, running.power.cuts, running.driver.stops) == (SlotState.CYCLING, 1, 1)
    running.until(SlotState.RUNNING)


def test_a_driver_that_cannot_start_as_its_module_is_stuck_gets_a_power_cycle_at_once(bench: Bench) -> None:
    bench.break_driver(StuckError("the modem answers nothing"))
    bench.until(SlotState.CYCLING)
    assert bench.driver.starts == 1


def test_while_power_is_away_no_driver_is_started_and_the_status_says_why(running: Bench) -> None:
    running.interface.fail(StuckError("the modem answers nothing"))
    starts = running.driver.starts
    running.loop.run_for(OFF_S + BOOT_S - 0.1)
    assert running.driver.starts == starts
    assert running.interface.why.startswith("slot v2x: ")


def test_a_device_that_does_not_show_itself_costs_a_power_cycle(loop: VirtualLoop) -> None:
    bench = Bench(loop)
    bench.power.has_module = False
    bench.slot.start()
    bench.until(SlotState.CYCLING)
    assert bench.loop.now == pytest.approx(1000 + SETTLE_S + WAIT_S)
    bench.power.has_module = True
    bench.until(SlotState.RUNNING)
    assert bench.slot.cycles == 1


@pytest.mark.parametrize("what", ["absent", "deaf", "stuck"])
def test_after_so_many_power_cycles_it_is_a_fault_with_the_first_cause(bench: Bench, what: str) -> None:
    match what:
        case "absent":
            bench.power.has_module = False
        case "deaf":
            bench.break_driver()
        case _:
            bench.break_driver(StuckError("the modem answers nothing"))
    bench.until(SlotState.FAULT)
    cause = {"absent": "no USB device at 1-1.3 within 30 s", "deaf": DEAF.message, "stuck": "the modem answers nothing"}
    status = bench.slot.status()
    assert (status["cause"], status["cycles"]) == (cause[what], CYCLES)
    assert status["why"] == f"{cause[what]}; given up after {CYCLES} power cycles"
    assert (bench.power.cuts, bench.power.is_on) == (CYCLES, True)


def test_the_cause_is_the_first_and_not_the_last(bench: Bench) -> None:
    bench.break_driver()
    bench.until(SlotState.CYCLING)
    bench.power.has_module = False
    bench.until(SlotState.FAULT)
    assert bench.slot.status()["cause"] == DEAF.message


def test_a_fault_stays(faulty: Bench) -> None:
    starts, switched = faulty.driver.starts, len(faulty.power.switched)
    faulty.loop.run_for(100_000)
    assert (faulty.state, faulty.driver.starts, len(faulty.power.switched)) == (SlotState.FAULT, starts, switched)


def test_a_fault_ends_when_a_device_is_plugged_in(faulty: Bench) -> None:
    faulty.power.unplug()
    assert faulty.state is SlotState.FAULT
    faulty.power.plug()
    assert faulty.state is SlotState.RUNNING
    assert faulty.slot.status()["cause"] == ""


@pytest.mark.parametrize("word", ["on", "cycle"])
def test_a_fault_ends_when_an_operator_asks(faulty: Bench, word: str) -> None:
    faulty.slot.operate(word)
    faulty.until(SlotState.RUNNING)
    assert faulty.slot.status()["cause"] == ""


def test_a_fault_that_an_operator_ends_may_use_all_power_cycles_again(faulty: Bench) -> None:
    faulty.break_driver()
    faulty.slot.operate("on")
    faulty.until(SlotState.FAULT, 2000)
    assert faulty.slot.cycles == CYCLES + 1 + CYCLES  # a fault ends with a power cycle


def test_what_ran_steadily_has_all_its_power_cycles_again(bench: Bench) -> None:
    stuck = StuckError("the modem answers nothing")
    for _ in range(5 * CYCLES):
        bench.until(SlotState.RUNNING)
        bench.loop.run_for(STEADY_S + 1)
        bench.interface.fail(stuck)
    bench.until(SlotState.POWERING)
    assert (bench.state, bench.slot.cycles) == (SlotState.POWERING, 5 * CYCLES)


def test_what_never_runs_steadily_ends_as_a_fault(bench: Bench) -> None:
    for _ in range(CYCLES + 1):
        bench.until(SlotState.RUNNING)
        bench.loop.run_for(STEADY_S / 2)
        bench.interface.fail(StuckError("the modem answers nothing"))
    assert bench.state is SlotState.FAULT


def test_a_failure_takes_the_steady_time_back(running: Bench) -> None:
    running.loop.run_for(STEADY_S - 1)
    running.interface.fail(DEAF)
    running.loop.run_for(5)
    assert (running.state, running.slot.status()["cause"]) == (SlotState.RUNNING, DEAF.message)
    running.loop.run_for(STEADY_S)
    assert running.slot.status()["cause"] == ""


def test_an_unplugged_device_is_waited_for_and_its_driver_stopped(running: Bench) -> None:
    running.power.unplug()
    assert (running.state, running.driver.stops, running.interface.is_up) == (SlotState.POWERING, 1, False)
    running.loop.run_for(WAIT_S / 2)
    running.power.plug()
    assert (running.state, running.power.cuts) == (SlotState.RUNNING, 0)


def test_a_device_that_stays_away_is_its_own_cause_and_not_what_its_driver_said_last(running: Bench) -> None:
    running.interface.fail(InterfaceError("/dev/ttyACM0 is gone: hung up"))
    running.power.unplug()
    running.until(SlotState.FAULT)
    assert running.slot.status()["cause"] == "no USB device at 1-1.3 within 30 s"


def test_a_device_that_leaves_while_its_driver_is_started_is_waited_for(bench: Bench) -> None:
    bench.break_driver()
    bench.until(SlotState.STARTING)
    bench.power.unplug()
    starts = bench.driver.starts
    bench.loop.run_for(WAIT_S - 1)
    assert (bench.state, bench.driver.starts) == (SlotState.POWERING, starts)


def test_a_device_that_never_comes_back_is_a_fault_until_it_does(running: Bench) -> None:
    running.power.unplug()
    running.until(SlotState.FAULT)
    assert running.slot.cycles == CYCLES
    running.power.plug()
    running.loop.run_for(5)
    assert running.state is SlotState.RUNNING


def test_a_switch_that_does_not_obey_is_a_fault_that_says_so(bench: Bench) -> None:
    bench.power.refusal = InterfaceError("no answer from 0x20 on /dev/i2c-1")
    bench.slot.operate("cycle")
    bench.until(SlotState.FAULT)
    assert bench.slot.status()["cause"] == "power off: no answer from 0x20 on /dev/i2c-1"
    bench.power.refusal = None
    bench.slot.operate("on")
    bench.until(SlotState.RUNNING)


def test_what_an_operator_switches_off_stays_off(running: Bench) -> None:
    running.slot.operate("off")
    assert (running.state, running.power.is_on, running.driver.stops) == (SlotState.OFF, False, 1)
    running.loop.run_for(10_000)
    assert (running.state, running.slot.cycles) == (SlotState.OFF, 0)
    running.slot.operate("on")
    running.until(SlotState.RUNNING)


@pytest.mark.parametrize(
    "state", [SlotState.POWERING, SlotState.STARTING, SlotState.RUNNING, SlotState.CYCLING, SlotState.FAULT]
)
@pytest.mark.parametrize("word", ["off", "cycle"])
def test_an_operator_may_switch_it_off_and_cycle_it_in_every_state(bench: Bench, state: SlotState, word: str) -> None:
    if state in (SlotState.STARTING, SlotState.CYCLING, SlotState.FAULT):
        bench.break_driver()
    bench.until(state)
    bench.mend_driver()
    bench.slot.operate(word)
    if word == "cycle":
        bench.until(SlotState.RUNNING)
    else:
        bench.loop.run_for(1000)
        assert (bench.state, bench.power.is_on) == (SlotState.OFF, False)


def test_a_slot_that_is_off_is_switched_on_by_a_power_cycle(running: Bench) -> None:
    running.slot.operate("off")
    running.loop.run_for(OFF_S)
    running.slot.operate("cycle")
    running.until(SlotState.RUNNING)


def test_a_slot_without_an_interface_is_left_as_it_is_until_an_operator_asks(loop: VirtualLoop) -> None:
    bench = Bench(loop, has_interface=False)
    bench.slot.start()
    loop.run_for(1000)
    assert (bench.state, bench.power.switched) == (SlotState.UNUSED, [])
    bench.slot.operate("on")
    bench.until(SlotState.RUNNING)
    bench.slot.operate("off")
    assert (bench.state, bench.power.is_on) == (SlotState.OFF, False)


@pytest.fixture
def empty(loop: VirtualLoop) -> Bench:
    """Nothing in it, no interface for it, and switched on by an operator, whose patience has come to its end."""
    bench = Bench(loop, has_interface=False)
    bench.power.has_module = False
    bench.slot.start()
    bench.slot.operate("on")
    bench.until(SlotState.EMPTY, within=SETTLE_S + WAIT_S + 1)
    return bench


def test_a_slot_that_was_switched_on_and_stays_empty_says_so_and_is_no_fault(empty: Bench) -> None:
    status = empty.slot.status()
    assert (status["why"], status["cause"], status["hint"]) == ("no device present", "", "")
    empty.loop.run_for(100_000)
    assert (empty.state, empty.power.is_on, empty.power.cuts) == (SlotState.EMPTY, True, 0)


def test_what_is_plugged_into_an_empty_slot_is_seen_and_missed_when_it_goes(empty: Bench) -> None:
    empty.power.plug()
    empty.until(SlotState.RUNNING, within=5)
    empty.power.unplug()
    assert empty.state is SlotState.POWERING
    empty.until(SlotState.EMPTY, within=WAIT_S + 1)
    assert empty.power.cuts == 0


def test_an_empty_slot_is_switched_off_and_cycled_as_any_other(empty: Bench) -> None:
    empty.slot.operate("cycle")
    empty.until(SlotState.POWERING, within=OFF_S + 1)
    empty.until(SlotState.EMPTY)
    empty.slot.operate("off")
    assert (empty.state, empty.power.is_on) == (SlotState.OFF, False)


def test_a_stop_keeps_the_power_and_ends_everything_else(running: Bench) -> None:
    running.slot.stop()
    running.slot.stop()
    running.power.unplug()
    running.power.plug()
    running.loop.run_for(1000)
    assert (running.state, running.power.is_on, running.power.cuts) == (SlotState.STOPPED, True, 0)
    assert (running.driver.starts, running.interface.is_up) == (1, False)


def test_every_decision_is_in_the_journal_once(bench: Bench, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    bench.break_driver()
    bench.until(SlotState.FAULT)
    assert lines(caplog, logging.ERROR) == [f"slot v2x: fault: {DEAF.message}; given up after {CYCLES} power cycles"]
    assert lines(caplog, logging.WARNING) == [f"slot v2x: cycling: {DEAF.message}"] * CYCLES
    assert len([r for r in caplog.records if r.name == "captain.supervisor"]) == 1


@pytest.mark.parametrize("seconds", [0.5, 7.0])
def test_a_bad_contact_floods_no_journal(running: Bench, caplog: pytest.LogCaptureFixture, seconds: float) -> None:
    caplog.set_level(logging.INFO, "captain.slots")
    began = running.loop.now
    for _ in range(1000):
        running.power.unplug()
        running.loop.run_for(seconds)
        running.power.plug()
        running.loop.run_for(seconds)
    said = [record for record in caplog.records if record.name == "captain.slots" and record.levelno >= logging.INFO]
    assert len(said) <= DECISIONS.burst + (running.loop.now - began) / DECISIONS.every_s


def test_the_status_says_what_is_there_and_what_has_happened(running: Bench) -> None:
    running.loop.run_for(2)
    assert running.slot.status() == {
        "title": "ITS-G5",
        "usb": "1-1.3",
        "device": "1e0e:9001",
        "note": "",
        "switched_by": "its power line",
        "losses": 0,
        "sequence": "present",
        "state": "running",
        "since_s": 2.0,
        "why": "driver started",
        "cause": "",
        "hint": "",
        "cycles": 0,
        "interface": "g5",
    }


def test_no_event_in_any_state_is_a_bug(loop: VirtualLoop) -> None:
    for state in SlotState:
        for event in Event:
            bench = Bench(loop)
            bench.slot.state = state
            bench.slot.dispatch(event)
            assert bench.state is state or (state, event) in RULES or event in FAULTS


def test_every_state_can_be_entered_and_left() -> None:
    assert {rule.state for rule in RULES.values()} | {SlotState.STOPPED, SlotState.UNUSED} == set(SlotState)
    assert {state for state, _ in RULES} == set(SlotState)


@pytest.mark.parametrize("seed", range(3))
def test_six_hours_of_modules_that_fail_at_random_end_well(loop: VirtualLoop, seed: int) -> None:
    """Whatever fails, in whatever state: power cycles are few, and the slot runs soon after the last failure."""
    bench = Bench(loop)
    bench.slot.start()
    chance = random.Random(seed)
    seen: Counter[SlotState] = Counter()

    def start(host: Host) -> None:
        if chance.random() < 0.3:
            raise DEAF
        host.link(True, "answers")

    bench.driver.on_start = start
    failures: list[Callable[[], None]] = [
        lambda: bench.interface.fail(DEAF),
        lambda: bench.interface.fail(StuckError("the modem answers nothing")),
        bench.power.unplug,
        bench.power.plug,
        lambda: bench.slot.operate(chance.choice(["on", "off", "cycle"])),
    ]
    while loop.now < 1000 + 6 * 3600:
        loop.run_for(chance.expovariate(1 / 60))
        chance.choice(failures)()
        seen[bench.state] += 1
    assert set(seen) == set(SlotState) - {SlotState.STOPPED, SlotState.UNUSED, SlotState.EMPTY}
    assert bench.slot.cycles <= bench.power.cuts  # an operator's `off` is none
    bench.power.plug()
    bench.mend_driver()
    bench.slot.operate("on")
    bench.until(SlotState.RUNNING, within=OFF_S + SETTLE_S + BOOT_S + 10)
    loop.run_for(STEADY_S)
    assert bench.slot.status()["cause"] == ""


def test_in_an_hour_a_slot_is_not_power_cycled_more_often_than_it_may(bench: Bench) -> None:
    """A module that hangs 61 s after each start is the worst that does not end as a fault: it ran steadily."""
    bench.driver.on_start = lambda host: bench.loop.after(STEADY_S + 1, lambda: host.fail(StuckError("hangs"))) and None
    bench.loop.run_for(3600)
    assert bench.slot.cycles <= 3600 / (STEADY_S + BOOT_S + OFF_S)
