"""Signals on the loop: one call each, in a turn, and given back at the end."""

import os
import signal
from contextlib import closing

from board.runtime.signals import Signals
from tests.virtual import VirtualLoop

FIRST, SECOND = signal.SIGUSR1, signal.SIGUSR2


def raise_(number: int) -> None:
    os.kill(os.getpid(), number)


def test_a_signal_makes_its_call_in_a_turn_and_not_before(loop: VirtualLoop) -> None:
    calls: list[str] = []
    with closing(Signals(loop, {FIRST: lambda: calls.append("first"), SECOND: lambda: calls.append("second")})):
        raise_(SECOND)
        assert calls == []
        loop.turn()
        assert calls == ["second"]
        raise_(FIRST)
        loop.turn()
        assert calls == ["second", "first"]


def test_two_of_one_number_are_two_calls(loop: VirtualLoop) -> None:
    calls: list[int] = []
    with closing(Signals(loop, {FIRST: lambda: calls.append(1)})):
        raise_(FIRST)
        raise_(FIRST)
        loop.turn()
        assert calls == [1, 1]


def test_a_signal_of_somebody_else_that_wakes_the_loop_makes_no_call(loop: VirtualLoop) -> None:
    calls: list[int] = []
    others: list[int] = []
    before = signal.signal(SECOND, lambda number, frame: others.append(number))
    try:
        with closing(Signals(loop, {FIRST: lambda: calls.append(1)})):
            raise_(SECOND)
            loop.turn()
            assert (calls, others) == ([], [SECOND])
    finally:
        signal.signal(SECOND, before)


def test_a_thousand_signals_while_nobody_turns_block_nothing(loop: VirtualLoop) -> None:
    calls: list[int] = []
    with closing(Signals(loop, {FIRST: lambda: calls.append(1)})):
        for _ in range(1000):
            raise_(FIRST)
        for _ in range(100):
            loop.turn()
        assert 0 < len(calls) <= 1000


def test_at_the_end_the_signals_belong_to_whom_they_belonged(loop: VirtualLoop) -> None:
    mine = lambda number, frame: None  # noqa: E731
    before = signal.signal(FIRST, mine)
    try:
        Signals(loop, {FIRST: lambda: None}).close()
        assert signal.getsignal(FIRST) is mine
        assert signal.set_wakeup_fd(-1) == -1
    finally:
        signal.signal(FIRST, before)


def test_a_call_may_close_the_signals(loop: VirtualLoop) -> None:
    signals = Signals(loop, {FIRST: lambda: signals.close()})  # noqa: PLW0108  # not bound yet
    raise_(FIRST)
    loop.turn()
    loop.turn()
