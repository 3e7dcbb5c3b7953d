"""A slot whose module comes and goes, stays silent, or cannot be switched: what the sequencer says, and who says it."""

from collections.abc import Iterator
from contextlib import closing

import pytest

from board.presence import FLAPS
from firmware.slots import CYCLES, State
from tests.firmware.slot_bench import Bench
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
