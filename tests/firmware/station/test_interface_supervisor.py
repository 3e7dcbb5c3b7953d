"""An interface's life: started, failing, tried again less and less often, forgiven, stopped."""

import logging
from collections.abc import Iterator
from contextlib import closing

import pytest

from board.runtime.errors import InterfaceError
from drivers.contract import Host, Sent
from drivers.message import Outcome
from drivers.reason import Reason
from firmware.routing.interface import InterfaceListener
from firmware.station.interface_supervisor import FIRST_S, MOST_S, InterfaceSupervisor
from tests.firmware.doubles import NotingStation, ScriptedDriver, interface_of, request_of
from tests.virtual import VirtualLoop

GONE = InterfaceError("ttyUSB0 is gone", "plug it in")


class Bench:
    def __init__(self, loop: VirtualLoop, chance: float = 0.5) -> None:
        self.loop = loop
        self.above = NotingStation()
        self.driver = ScriptedDriver()
        self.interface = interface_of(loop, self.above, self.driver)
        self.interface.link(False, "not started")
        self.driver.starts = 0
        self.moments: list[float] = []
        self.life = InterfaceSupervisor(loop, self.interface, lambda: chance)

    def fail_to_start(self) -> None:
        def start(host: Host) -> None:
            self.moments.append(self.loop.now)
            raise GONE

        self.driver.on_start = start

    @property
    def delays(self) -> list[float]:
        return [round(late - early, 6) for early, late in zip(self.moments, self.moments[1:], strict=False)]


@pytest.fixture
def bench() -> Iterator[Bench]:
    with closing(VirtualLoop()) as loop:
        yield Bench(loop)


def test_what_was_never_started_is_stopped(bench: Bench) -> None:
    assert bench.life.state == "stopped"


def test_an_interface_is_up_or_down_with_its_link(bench: Bench) -> None:
    bench.life.start()
    assert bench.life.state == "up"
    bench.interface.link(False, "no carrier")
    assert bench.life.state == "down"
    bench.interface.link(True, "carrier")
    assert bench.life.state == "up"
    assert bench.life.restarts == 0


def test_a_driver_that_never_reports_a_link_is_starting(bench: Bench) -> None:
    bench.driver.on_start = lambda host: None
    bench.life.start()
    assert bench.life.state == "starting"


def test_a_bring_up_is_starting_until_the_link_is_up_or_a_fault_is_known(bench: Bench) -> None:
    bench.driver.on_start = lambda host: host.starting("identifying the receiver")
    bench.life.start()
    assert (bench.life.state, bench.interface.why) == ("starting", "identifying the receiver")
    assert bench.life.is_running
    bench.interface.link(False, "no answer")
    assert bench.life.state == "down"
    bench.interface.starting("identifying the receiver")
    assert bench.life.state == "starting"
    bench.interface.link(True, "ZED-F9P")
    assert bench.life.state == "up"


def test_start_after_a_failure_is_starting_until_it_reports_its_link(bench: Bench) -> None:
    bench.life.start()
    bench.driver.on_start = lambda host: None
    bench.life.driver_failed(GONE)
    assert (bench.life.state, bench.interface.why) == ("waiting", GONE.message)
    bench.loop.run_for(1)
    assert bench.life.state == "starting"
    assert "link" in bench.interface.why
    bench.interface.link(False, GONE.message)
    assert (bench.life.state, bench.interface.why) == ("down", GONE.message)


def test_start_after_a_hold_does_not_keep_the_reason_of_the_hold(bench: Bench) -> None:
    bench.life.start()
    bench.life.hold("slot v2x was switched off by operator")
    bench.driver.on_start = lambda host: None
    bench.life.start()
    assert bench.life.state == "starting"
    assert "link" in bench.interface.why
    assert "slot v2x" not in bench.interface.why


def test_what_cannot_start_is_tried_again_less_and_less_often(bench: Bench) -> None:
    bench.fail_to_start()
    bench.life.start()
    assert bench.life.state == "waiting"
    bench.loop.run_for(30)
    assert bench.delays[:6] == [FIRST_S, 2 * FIRST_S, 4 * FIRST_S, 8 * FIRST_S, 16 * FIRST_S, MOST_S]
    assert set(bench.delays[5:]) == {MOST_S}
    assert bench.life.restarts == len(bench.moments)


@pytest.mark.parametrize(("chance", "factor"), [(0.0, 0.8), (0.5, 1.0), (1.0, 1.2)])
def test_the_delay_varies_so_that_not_all_return_together(chance: float, factor: float) -> None:
    with closing(VirtualLoop()) as loop:
        bench = Bench(loop, chance)
        bench.fail_to_start()
        bench.life.start()
        loop.run_for(1)
        assert bench.delays[0] == pytest.approx(FIRST_S * factor)


def test_what_can_start_again_is_up_again(bench: Bench) -> None:
    bench.fail_to_start()
    bench.life.start()
    bench.driver.on_start = lambda host: host.link(True, "plugged in")
    bench.loop.run_for(1)
    assert bench.life.state == "up"
    assert bench.driver.starts == 2


def test_the_reason_is_shown_while_it_waits(bench: Bench) -> None:
    bench.fail_to_start()
    bench.life.start()
    status = bench.life.status()
    assert (status["state"], status["why"], status["restarts"]) == ("waiting", "ttyUSB0 is gone", 1)


def said(caplog: pytest.LogCaptureFixture) -> int:
    return len([r for r in caplog.records if r.name == "captain.supervisor" and r.levelno == logging.WARNING])


class NotingListener(InterfaceListener):
    def __init__(self) -> None:
        self.reports: list[tuple[str, str]] = []

    def link_changed(self, state: str, why: str) -> None:
        self.reports.append((state, why))


def test_the_same_fault_is_said_once_however_often_it_is_met(bench: Bench, caplog: pytest.LogCaptureFixture) -> None:
    bench.fail_to_start()
    bench.life.start()
    bench.loop.run_for(60)
    assert bench.driver.starts > 10
    assert said(caplog) == 1


def test_a_start_that_fails_again_and_again_reports_its_link_once(
    bench: Bench, caplog: pytest.LogCaptureFixture
) -> None:
    listener = bench.interface.listener = NotingListener()
    bench.fail_to_start()
    with caplog.at_level(logging.INFO, "captain.interface"):
        bench.life.start()
        bench.loop.run_for(60)
    assert bench.driver.starts > 10
    assert listener.reports == [("down", GONE.message)]
    assert [r.message for r in caplog.records if r.name == "captain.interface"] == [f"g5: down: {GONE.message}"]


def test_another_fault_is_said_as_well(bench: Bench, caplog: pytest.LogCaptureFixture) -> None:
    bench.fail_to_start()
    bench.life.start()

    def start(host: Host) -> None:
        raise InterfaceError("ttyUSB0 is busy")

    bench.driver.on_start = start
    bench.loop.run_for(30)
    assert said(caplog) == 2


def test_a_fault_that_returns_after_each_short_start_is_said_once(
    bench: Bench, caplog: pytest.LogCaptureFixture
) -> None:
    bench.driver.on_start = lambda host: host.loop.after(1.0, lambda: host.fail(GONE)) and None
    bench.life.start()
    bench.loop.run_for(60)
    assert bench.driver.starts > 5
    assert said(caplog) == 1


def test_a_fault_that_returns_after_it_was_forgiven_is_said_again(
    bench: Bench, caplog: pytest.LogCaptureFixture
) -> None:
    bench.life.start()
    bench.interface.fail(GONE)
    bench.loop.run_for(30)
    bench.interface.fail(GONE)
    assert said(caplog) == 2


def test_a_driver_that_fails_is_stopped_and_started_again(bench: Bench) -> None:
    bench.life.start()
    bench.interface.fail(GONE)
    assert (bench.life.state, bench.driver.stops) == ("waiting", 1)
    bench.loop.run_for(1)
    assert (bench.life.state, bench.driver.starts) == ("up", 2)


def test_a_driver_that_fails_loses_what_it_kept_and_nothing_else(bench: Bench) -> None:
    bench.life.start()
    bench.driver.answer = Sent.LATER
    bench.interface.outlet.submit(request_of(1))
    bench.driver.answer = Sent.BUSY
    bench.interface.outlet.submit(request_of(2))
    bench.driver.answer = Sent.NOW
    bench.interface.fail(GONE)
    assert bench.above.outcomes() == [(1, Outcome.DROPPED, Reason.SEND_FAILED)]
    bench.loop.run_for(1)
    assert bench.above.outcomes()[1:] == [(2, Outcome.SENT, None)]


def test_a_driver_that_fails_again_and_again_is_tried_less_and_less_often(bench: Bench) -> None:
    def start(host: Host) -> None:
        bench.moments.append(bench.loop.now)
        host.link(True, "plugged in")
        bench.loop.after(1.0, lambda: host.fail(GONE))

    bench.driver.on_start = start
    bench.life.start()
    bench.loop.run_for(60)
    pauses = [delay - 1.0 for delay in bench.delays]
    assert pauses[:6] == pytest.approx([FIRST_S, 2 * FIRST_S, 4 * FIRST_S, 8 * FIRST_S, 16 * FIRST_S, MOST_S])
    assert pauses[6:] == pytest.approx([MOST_S] * len(pauses[6:]))


def test_a_driver_that_ran_for_a_while_is_forgiven(bench: Bench) -> None:
    bench.fail_to_start()
    bench.life.start()
    bench.loop.run_for(5)
    bench.driver.on_start = lambda host: host.link(True, "plugged in")
    bench.loop.run_for(30)
    assert bench.life.state == "up"
    starts = bench.driver.starts
    bench.interface.fail(GONE)
    bench.loop.run_for(FIRST_S)
    assert bench.driver.starts == starts + 1


@pytest.mark.parametrize("raises_too", [False, True])
def test_a_driver_that_fails_inside_start_is_started_once_at_a_time(bench: Bench, raises_too: bool) -> None:
    def start(host: Host) -> None:
        host.fail(GONE)
        if raises_too:
            raise GONE

    bench.driver.on_start = start
    bench.life.start()
    assert (bench.life.state, bench.life.restarts) == ("waiting", 1)
    bench.driver.on_start = lambda host: host.link(True, "plugged in")
    bench.loop.run_for(30)
    assert (bench.life.state, bench.driver.starts) == ("up", 2)


def test_a_second_failure_while_it_waits_changes_nothing(bench: Bench) -> None:
    bench.life.start()
    bench.interface.fail(GONE)
    bench.interface.fail(GONE)
    assert (bench.life.restarts, bench.driver.stops) == (1, 1)
    bench.loop.run_for(30)
    assert bench.driver.starts == 2


def test_a_stop_while_it_waits_ends_the_tries(bench: Bench) -> None:
    bench.fail_to_start()
    bench.life.start()
    bench.life.stop()
    bench.loop.run_for(30)
    assert (bench.life.state, bench.driver.starts) == ("stopped", 1)


def test_a_stop_leaves_the_last_count_to_the_driver_and_may_come_twice(bench: Bench) -> None:
    bench.life.start()
    bench.life.stop()
    bench.life.stop()
    assert (bench.driver.refreshes, bench.life.state, bench.interface.is_up) == (0, "stopped", False)


def test_a_failure_after_the_stop_starts_nothing(bench: Bench) -> None:
    bench.life.start()
    bench.life.stop()
    bench.interface.fail(GONE)
    bench.loop.run_for(30)
    assert (bench.life.state, bench.driver.starts) == ("stopped", 1)


def test_only_a_running_driver_is_asked_for_its_counters(bench: Bench) -> None:
    bench.life.refresh()
    bench.life.start()
    bench.life.refresh()
    assert bench.driver.refreshes == 1
    bench.interface.fail(GONE)
    bench.life.refresh()
    assert bench.driver.refreshes == 1


def test_what_is_no_expected_failure_passes_through(bench: Bench) -> None:
    def start(host: Host) -> None:
        raise ZeroDivisionError

    bench.driver.on_start = start
    with pytest.raises(ZeroDivisionError):
        bench.life.start()


@pytest.mark.parametrize("end", ["hold", "stop", "fail"])
def test_what_a_driver_told_of_its_module_goes_with_it(bench: Bench, end: str) -> None:
    bench.life.start()
    bench.interface.report_details({"fix": "3d", "age_s": 0.1})
    # What it says last is no more of now than what it said before.
    bench.driver.on_stop = lambda: bench.interface.report_details({"fix": "3d", "age_s": 0.2})
    {
        "hold": lambda: bench.life.hold("switched off"),
        "stop": bench.life.stop,
        "fail": lambda: bench.interface.fail(GONE),
    }[end]()
    assert "details" not in bench.life.status()
