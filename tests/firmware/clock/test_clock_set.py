"""When the clock of a machine counts as set."""

import time
from pathlib import Path

import pytest

from board.time.scales import Lock
from firmware.clock.clock_set import ClockSet
from firmware.clock.own_time import OwnTime
from firmware.clock.system_clock import SystemClock
from tests.virtual import VirtualLoop


def test_a_machine_whose_early_boot_made_nothing_up_is_believed_though_nobody_steers_it(tmp_path: Path):
    assert ClockSet(tmp_path / "none", lambda: False)()


def test_a_time_that_was_made_up_is_none_until_somebody_steers_the_clock_and_is_one_from_then_on(tmp_path: Path):
    mark = tmp_path / "early.clock"
    mark.touch()
    steered = iter([False, False, True, False])
    found = ClockSet(mark, lambda: next(steered))
    # Once it was set, nobody is asked any more: the fourth answer is never fetched.
    assert [found() for _ in range(4)] == [False, False, True, True]
    assert next(steered) is False


@pytest.mark.parametrize("now_s", [12.0, 5_471_000_000.0])
def test_a_clock_before_2004_or_beyond_2143_is_not_set(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, now_s: float):
    monkeypatch.setattr("firmware.clock.clock_set.time.time", lambda: now_s)
    assert not ClockSet(tmp_path / "none", lambda: True)()


def test_own_time_goes_by_no_clock_that_was_never_set():
    own = OwnTime(time.monotonic)
    assert own.its_ms(time.monotonic()) is not None
    own.is_system_set = lambda: False
    assert own.its_ms(time.monotonic()) is None


def test_of_a_clock_that_was_never_set_nothing_is_known():
    loop = VirtualLoop()
    assert SystemClock(loop, False, lambda: False).quality().state is Lock.UNKNOWN
    assert SystemClock(loop, False, lambda: True).quality().state is Lock.SYSTEM
