"""A slot whose module comes and goes, stays silent, or cannot be switched: what the sequencer says, and who says it."""

import random
from collections.abc import Callable

import pytest

from board.presence import FLAPS
from board.runtime.errors import InterfaceError, StationError, StuckError
from board.slot import SequencerState as Sequence
from drivers.contract import Host
from firmware.slots.states import MEANINGS, Event, SlotState
from firmware.slots.supervisor import CYCLES, FIRST_RESWITCH_S, RESWITCH_S, RULES, STEADY_S
from tests.firmware.slots.bench import BOOT_S, DEAF, OFF_S, SETTLE_S, Bench
from tests.virtual import VirtualLoop


def test_a_device_that_comes_and_goes_is_given_a_power_cycle(running: Bench) -> None:
    running.power.flap()
    assert (running.state, running.power.cuts, running.interface.is_up) == (SlotState.CYCLING, 1, False)
    assert running.slot.status()["cause"] == f"its device at 1-1.3 disappeared {FLAPS} times within 60 s"


def test_a_device_that_comes_and_goes_while_its_driver_is_started_is_given_one_as_well(bench: Bench) -> None:
    bench.break_driver()
    bench.until(SlotState.STARTING)
    bench.power.flap()
    assert (bench.state, bench.power.cuts) == (SlotState.CYCLING, 1)


def test_a_device_that_comes_and_goes_after_each_power_cycle_is_a_fault_at_last(running: Bench) -> None:
    for _ in range(CYCLES + 1):
        running.until(SlotState.RUNNING)
        running.power.flap()
        running.power.has_module = True
    assert (running.state, running.slot.cycles, running.driver.stops) == (
        SlotState.FAULT,
        CYCLES,
        running.driver.starts,
    )


def test_a_module_that_stays_silent_is_a_fault_although_its_driver_runs_for_longer_than_steadily(bench: Bench) -> None:
    def start(host: Host) -> None:
        host.link(False, "port: no answer to AT")
        bench.loop.after(1.5 * STEADY_S, lambda: host.fail(StuckError("no answer to AT within 90 s")))

    bench.driver.on_start = start
    bench.until(SlotState.FAULT)
    assert (bench.slot.cycles, bench.slot.status()["cause"]) == (CYCLES, "no answer to AT within 90 s")


def test_only_with_its_link_up_it_runs_steadily(running: Bench) -> None:
    running.interface.fail(DEAF)
    running.until(SlotState.RUNNING)
    running.interface.link(False, "no network")
    running.loop.run_for(10 * STEADY_S)
    running.interface.link(True, "registered")
    running.loop.run_for(STEADY_S - 1)
    assert running.slot.status()["cause"] == DEAF.message
    running.loop.run_for(2)
    assert running.slot.status()["cause"] == ""


def test_a_link_that_comes_and_goes_is_not_steady(running: Bench) -> None:
    running.interface.fail(DEAF)
    running.until(SlotState.RUNNING)
    for _ in range(100):
        running.loop.run_for(STEADY_S - 1)
        running.interface.link(False, "no network")
        running.loop.run_for(1)
        running.interface.link(True, "registered")
    assert running.slot.status()["cause"] == DEAF.message


HINT = "is the carrier plugged on?"


def refuse(bench: Bench) -> None:
    bench.power.refusal = InterfaceError("no answer from 0x20 on /dev/i2c-1", HINT)


def test_switch_that_fails_at_the_start_is_a_fault_and_no_power_cycle(loop: VirtualLoop) -> None:
    bench = Bench(loop)
    refuse(bench)
    bench.slot.start()
    status = bench.slot.status()
    assert (bench.state, bench.slot.cycles) == (SlotState.FAULT, 0)
    assert status["cause"] == "power on: no answer from 0x20 on /dev/i2c-1"
    assert status["hint"] == HINT
    assert status["why"] == f"{status['cause']}; tried again, at most every {RESWITCH_S:.0f} s"


def test_a_switch_that_fails_once_costs_seconds(loop: VirtualLoop) -> None:
    bench = Bench(loop)
    refuse(bench)
    bench.slot.start()
    bench.power.refusal = None
    bench.until(SlotState.RUNNING, within=FIRST_RESWITCH_S + OFF_S + SETTLE_S + BOOT_S + 1)
    assert (bench.slot.status()["cause"], bench.slot.cycles) == ("", 0)


def test_a_switch_that_fails_for_long_is_tried_seldom_and_said_once(
    loop: VirtualLoop, caplog: pytest.LogCaptureFixture
) -> None:
    bench = Bench(loop)
    refuse(bench)
    bench.slot.start()
    tries = bench.power.tries
    loop.run_for(3600)
    # Each try cuts first, goes on with what it failed at, and comes no sooner than the pause.
    assert 3600 / (RESWITCH_S + 1) - 5 < bench.power.tries - tries < 3600 / RESWITCH_S + 5
    assert [r.getMessage() for r in caplog.records if r.levelname == "ERROR"] == [
        f"slot v2x: fault: {bench.slot.status()['why']}"
    ]
    bench.power.refusal = None
    bench.until(SlotState.RUNNING, within=RESWITCH_S + OFF_S + SETTLE_S + BOOT_S + 1)


def test_what_is_absent_once_its_power_could_be_switched_may_use_all_power_cycles(loop: VirtualLoop) -> None:
    bench = Bench(loop)
    refuse(bench)
    bench.power.has_module = False
    bench.slot.start()
    bench.power.refusal = None
    bench.until(SlotState.POWERING)
    bench.until(SlotState.FAULT)
    assert bench.slot.cycles == CYCLES
    assert bench.slot.status()["cause"] == "no USB device at 1-1.3 within 30 s"


def test_slot_that_could_not_be_switched_off_is_a_fault_and_on(running: Bench) -> None:
    refuse(running)
    running.slot.operate("off")
    status = running.slot.status()
    assert (running.state, running.power.is_on) == (SlotState.FAULT, True)
    assert status["cause"] == "power off: no answer from 0x20 on /dev/i2c-1"
    assert status["hint"] == HINT


def test_a_slot_that_could_not_be_switched_off_is_as_soon_as_it_can(running: Bench) -> None:
    refuse(running)
    running.slot.operate("off")
    running.loop.run_for(3600)
    running.power.refusal = None
    running.until(SlotState.OFF, within=RESWITCH_S + OFF_S + 1)
    running.loop.run_for(3600)
    assert (running.state, running.power.is_on, running.slot.status()["cause"]) == (SlotState.OFF, False, "")


def test_a_power_cycle_that_is_asked_for_while_there_is_one_begins_again(running: Bench) -> None:
    running.slot.operate("cycle")
    running.loop.run_for(OFF_S - 1)
    running.slot.operate("cycle")
    running.loop.run_for(OFF_S - 0.5)
    assert (running.state, running.power.is_on) == (SlotState.CYCLING, False)
    running.until(SlotState.RUNNING)
    assert (running.slot.cycles, running.power.cuts) == (1, 1)


# What a slot that is told by its sequencer need not do anything about, and why.
AS_IT_IS = {
    (SlotState.OFF, Event.UNSUPPLIED): "it is off already",
    (SlotState.POWERING, Event.SUPPLIED): "that is what it waits for",
    (SlotState.POWERING, Event.RELEASED): "its device is waited for",
    (SlotState.FAULT, Event.SUPPLIED): "whether reset can be released is not known yet",
    (SlotState.FAULT, Event.UNPLUGGED): "the fault stays until there is one again",
    (SlotState.FAULT, Event.ABSENT): "the fault stays",
    (SlotState.FAULT, Event.UNSWITCHED): "the fault stays, and it is tried again",
}

# How a slot and its sequencer may be at the same moment. In a fault, its device may be there or be waited for, and its
# switches are tried.
TOGETHER = {
    SlotState.UNUSED: {Sequence.OFF},
    SlotState.OFF: {Sequence.OFF},
    SlotState.POWERING: {Sequence.OFF, Sequence.POWERED, Sequence.RELEASED},
    SlotState.STARTING: {Sequence.PRESENT},
    SlotState.RUNNING: {Sequence.PRESENT},
    SlotState.CYCLING: {Sequence.OFF},
    SlotState.EMPTY: {Sequence.FAULT},
    SlotState.FAULT: set(Sequence),
}


@pytest.mark.parametrize("seed", range(4))
def test_a_slot_and_its_sequencer_never_disagree(loop: VirtualLoop, seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Days of a bad contact, a bus that fails, a driver that fails and an operator who tries everything."""
    bench = Bench(loop, has_interface=seed != 0)
    chance = random.Random(seed)
    told: set[tuple[SlotState, Event]] = set()
    tell = bench.slot.dispatch

    def note(event: Event, why: str | StationError = "") -> None:
        told.add((bench.state, event))
        tell(event, why)

    monkeypatch.setattr(bench.slot, "dispatch", note)
    bench.slot.start()
    happens: list[Callable[[], None]] = [
        bench.power.unplug,
        bench.power.plug,
        bench.power.flap,
        lambda: refuse(bench),
        lambda: setattr(bench.power, "refusal", None),
        lambda: bench.slot.operate(chance.choice(["on", "off", "cycle"])),
        lambda: bench.interface.fail(chance.choice([DEAF, StuckError("the modem answers nothing")])),
        lambda: bench.interface.link(not bench.interface.is_up, "network"),
    ]
    for _ in range(2000):
        chance.choice(happens)()
        assert bench.sequencer.state in TOGETHER[bench.state]
        loop.run_for(chance.expovariate(1 / 10))
        assert bench.sequencer.state in TOGETHER[bench.state]
    by_sequencer = {*MEANINGS.values(), Event.RELEASED, Event.UNSWITCHED, Event.UNSUPPLIED, Event.VACANT}
    assert {passage for passage in told if passage[1] in by_sequencer} <= set(RULES) | set(AS_IT_IS)
    assert not set(AS_IT_IS) & set(RULES)
