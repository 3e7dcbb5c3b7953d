"""Station without a receiver: source of time, or unknown."""

from collections.abc import Iterator
from contextlib import closing
from typing import Any

import pytest

from board.runtime.errors import InterfaceError
from board.time import leaps
from board.time.scales import EPOCH, Lock, TimeQuality
from firmware.clock import system_clock
from firmware.clock.own_time import OwnTime
from firmware.clock.system_clock import SystemClock
from firmware.clock.timekeeper import Timekeeper
from firmware.config import board_file
from firmware.config.tables import TimeOptions
from firmware.station.simulation import Simulation
from pps.chrony import tracking
from pps.chrony.tracking import Tracking
from pps.kernel_clock import KernelClock, State
from tests.virtual import VirtualLoop

NOW = 1_795_182_426.0
STEERED = KernelClock(State.OK, True, 0, 12_000.0, 20_000, 1_500_000, 37)


class PlayedTracker:
    """pps.chrony.tracking.Tracker that has asked chronyd already."""

    latest: Tracking | None = None
    why = ""

    def __init__(self, *arguments: object) -> None:
        self.is_running = False

    def start(self) -> None:
        self.is_running = True

    def stop(self) -> None:
        self.is_running = False


@pytest.fixture
def told() -> list[TimeQuality]:
    return []


@pytest.fixture
def loop(monkeypatch: pytest.MonkeyPatch) -> Iterator[VirtualLoop]:
    monkeypatch.setattr("time.time", lambda: NOW)
    monkeypatch.setattr(tracking, "Tracker", PlayedTracker)
    monkeypatch.setattr(PlayedTracker, "latest", None)
    with closing(VirtualLoop()) as loop:
        yield loop


def run(loop: VirtualLoop, told: list[TimeQuality], options: TimeOptions | None = None) -> dict[str, Any]:
    """The status after some seconds."""
    simulation = Simulation(loop, board_file.load("none"))
    keeper = Timekeeper(loop, options or TimeOptions(), None, OwnTime(loop.clock), told.append, simulation)
    keeper.start([])
    loop.run_for(3.5)
    status = keeper.status()
    keeper.stop()
    keeper.stop()
    return status


def says(monkeypatch: pytest.MonkeyPatch, clock: KernelClock) -> None:
    monkeypatch.setattr(system_clock, "kernel_clock", lambda: clock)


def test_a_clock_that_somebody_steers_is_as_exact_as_the_kernel_says(
    loop: VirtualLoop, told: list[TimeQuality], monkeypatch: pytest.MonkeyPatch
) -> None:
    says(monkeypatch, STEERED)
    status = run(loop, told)
    assert told == [TimeQuality(Lock.SYSTEM, 0, 1_500_000)] * 3
    assert (status["state"], status["error_ns"]) == ("system", 1_500_000)


def test_a_clock_that_nobody_steers_has_no_bound(
    loop: VirtualLoop, told: list[TimeQuality], monkeypatch: pytest.MonkeyPatch
) -> None:
    says(monkeypatch, STEERED._replace(is_synchronised=False))
    status = run(loop, told)
    assert (status["state"], status["offset_ns"], status["error_ns"]) == ("system", None, None)


def test_a_kernel_that_says_nothing_is_none(
    loop: VirtualLoop, told: list[TimeQuality], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse() -> KernelClock:
        raise InterfaceError("adjtimex: errno 1")

    monkeypatch.setattr(system_clock, "kernel_clock", refuse)
    assert run(loop, told)["state"] == "system"


def test_a_clock_that_is_not_set_is_nobodys_word(
    loop: VirtualLoop, told: list[TimeQuality], monkeypatch: pytest.MonkeyPatch
) -> None:
    says(monkeypatch, STEERED)
    monkeypatch.setattr("time.time", lambda: EPOCH - 1.0)
    status = run(loop, told)
    assert (status["state"], status["its_ms"]) == ("unknown", None)


def test_chronyd_is_asked_where_that_is_wanted_and_its_word_is_taken(
    loop: VirtualLoop, told: list[TimeQuality], monkeypatch: pytest.MonkeyPatch
) -> None:
    says(monkeypatch, STEERED)
    numbers = (NOW, -1.5e-5, 0.0, 0.0, 12.5, 0.0, 0.1, 0.002, 0.0005, 64.0)
    monkeypatch.setattr(PlayedTracker, "latest", Tracking("C0000201", "192.0.2.1", 2, *numbers, "Normal"))
    status = run(loop, told, TimeOptions(tracking=True))
    # |offset| + dispersion + delay / 2, and 15 ppm of the seconds since; the answer was up to a second old when seen.
    assert told == [TimeQuality(Lock.SYSTEM, 0, 1_515_000 + 15_000 * age_s) for age_s in (1, 2, 3)]
    assert (status["tracking"]["reference"], status["tracking"]["stratum"]) == ("192.0.2.1", 2)


@pytest.mark.parametrize(
    ("options", "is_asked"),
    [
        (TimeOptions(), False),
        (TimeOptions(chrony="/run/none"), True),
        (TimeOptions(chrony="/run/none", tracking=False), False),
        (TimeOptions(tracking=True), True),
    ],
)
def test_chronyd_is_asked_where_it_is_fed_or_that_is_wanted(
    loop: VirtualLoop, told: list[TimeQuality], options: TimeOptions, is_asked: bool
) -> None:
    assert (run(loop, told, options)["tracking"] is not None) is is_asked


def test_leap_seconds_of_the_list_are_those_of_own_time(
    loop: VirtualLoop, told: list[TimeQuality], monkeypatch: pytest.MonkeyPatch
) -> None:
    says(monkeypatch, STEERED)
    listed = leaps.BUILT_IN.told(19, None, round(NOW - EPOCH) - 86_400)
    monkeypatch.setattr(leaps, "known", lambda path, unix_s: listed)
    status = run(loop, told)
    assert (status["leap"]["seconds"], status["its_ms"]) == (6, round((NOW - EPOCH + 6) * 1000))


def test_an_answer_of_chronyd_ages_until_the_next(
    loop: VirtualLoop, told: list[TimeQuality], monkeypatch: pytest.MonkeyPatch
) -> None:
    numbers = (NOW, 0.5, 0.0, 0.0, 12.5, 0.0, 0.1, 0.002, 0.0005, 64.0)
    monkeypatch.setattr(PlayedTracker, "latest", Tracking("C0000201", "192.0.2.1", 2, *numbers, "Normal"))
    clock = SystemClock(loop, is_asked=True)
    assert clock.chronyds_ns() == 500_000_000 + 1_500_000 + 15_000  # it is slewed, and is half a second wrong at most
    loop.run_for(12.0)
    assert clock.chronyds_ns() == 500_000_000 + 1_500_000 + 15_000 * 13
