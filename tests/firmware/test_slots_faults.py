"""A slot whose module comes and goes, stays silent, or cannot be switched: what the sequencer says, and who says it."""

from collections.abc import Iterator
from contextlib import closing

import pytest

from board.errors import StuckError
from board.presence import FLAPS
from drivers.contract import Host
from firmware.slots import CYCLES, STEADY_S, State
from tests.firmware.slot_bench import DEAF, Bench
from tests.virtual import VirtualLoop


@pytest.fixture
def loop() -> Iterator[VirtualLoop]:
    with closing(VirtualLoop()) as loop:
        yield loop


@pytest.fixture
def bench(loop: VirtualLoop) -> Bench:
    bench = Bench(loop)
    bench.slot.start()
    return bench


@pytest.fixture
def running(bench: Bench) -> Bench:
    bench.until(State.RUNNING)
    return bench


def test_a_device_that_comes_and_goes_is_given_a_power_cycle(running: Bench) -> None:
    running.power.flap()
    assert (running.state, running.power.cuts, running.interface.is_up) == (State.CYCLING, 1, False)
    assert running.slot.status()["cause"] == f"its device at 1-1.3 went {FLAPS} times within 60 s"


def test_a_device_that_comes_and_goes_while_its_driver_is_started_is_given_one_as_well(bench: Bench) -> None:
    bench.break_driver()
    bench.until(State.STARTING)
    bench.power.flap()
    assert (bench.state, bench.power.cuts) == (State.CYCLING, 1)


def test_a_device_that_comes_and_goes_after_each_power_cycle_is_a_fault_at_last(running: Bench) -> None:
    for _ in range(CYCLES + 1):
        running.until(State.RUNNING)
        running.power.flap()
        running.power.has_module = True
    assert (running.state, running.slot.cycles, running.driver.stops) == (State.FAULT, CYCLES, running.driver.starts)


def test_a_module_that_stays_silent_is_a_fault_although_its_driver_runs_for_longer_than_steadily(bench: Bench) -> None:
    def start(host: Host) -> None:
        host.link(False, "port: no answer to AT")
        bench.loop.after(1.5 * STEADY_S, lambda: host.fail(StuckError("no answer to AT within 90 s")))

    bench.driver.on_start = start
    bench.until(State.FAULT)
    assert (bench.slot.cycles, bench.slot.status()["cause"]) == (CYCLES, "no answer to AT within 90 s")


def test_only_with_its_link_up_it_runs_steadily(running: Bench) -> None:
    running.interface.fail(DEAF)
    running.until(State.RUNNING)
    running.interface.link(False, "no network")
    running.loop.run_for(10 * STEADY_S)
    running.interface.link(True, "registered")
    running.loop.run_for(STEADY_S - 1)
    assert running.slot.status()["cause"] == DEAF.message
    running.loop.run_for(2)
    assert running.slot.status()["cause"] == ""


def test_a_link_that_comes_and_goes_is_not_steady(running: Bench) -> None:
    running.interface.fail(DEAF)
    running.until(State.RUNNING)
    for _ in range(100):
        running.loop.run_for(STEADY_S - 1)
        running.interface.link(False, "no network")
        running.loop.run_for(1)
        running.interface.link(True, "registered")
    assert running.slot.status()["cause"] == DEAF.message
