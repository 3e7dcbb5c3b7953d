"""The loop: descriptors, timers, and what may happen to either while another is served."""

import os
import select
import socket
from collections.abc import Callable, Iterator
from contextlib import closing

import pytest

from board.runtime.loop import MAX_EVENTS, READ, WRITE, Loop
from tests.virtual import VirtualLoop


class End:
    """One end of a socket pair as a Source that notes what it was given."""

    def __init__(self, loop: Loop, action: Callable[["End"], None] | None = None) -> None:
        self.near, self.far = socket.socketpair()
        self.near.setblocking(False)
        self.loop = loop
        self.action = action
        self.events: list[int] = []

    def fileno(self) -> int:
        return self.near.fileno()

    def ready(self, events: int) -> None:
        self.events.append(events)
        if self.action is not None:
            self.action(self)

    def close(self) -> None:
        self.loop.remove(self)
        self.near.close()
        self.far.close()


class Flag:
    """An eventfd as a Source: one descriptor, ready when it is not zero."""

    def __init__(self, loop: Loop, value: int, action: Callable[["Flag"], None] = lambda flag: None) -> None:
        self.number = os.eventfd(value, os.EFD_NONBLOCK)
        self.loop = loop
        self.action = action
        self.served = 0
        loop.add(self)

    def fileno(self) -> int:
        return self.number

    def ready(self, events: int) -> None:
        self.served += 1
        os.eventfd_read(self.number)
        self.action(self)

    def close(self) -> None:
        if self.loop._sources.get(self.number) is self:
            self.loop.remove(self)
            os.close(self.number)


class Sources:
    """Ends that are added and closed with the test."""

    def __init__(self, loop: Loop) -> None:
        self.loop = loop
        self.made: list[End] = []

    def __call__(self, action: Callable[[End], None] | None = None, *, is_ready: bool = False) -> End:
        end = End(self.loop, action)
        self.made.append(end)
        self.loop.add(end)
        if is_ready:
            end.far.send(b"x")
        return end

    def close(self) -> None:
        for end in self.made:
            if end.near.fileno() >= 0:
                end.close()


@pytest.fixture
def make(loop: VirtualLoop) -> Iterator[Sources]:
    sources = Sources(loop)
    yield sources
    sources.close()


# descriptors


def test_a_source_is_served_once_a_turn_while_it_is_ready(loop: VirtualLoop, make: Sources):
    end = make(is_ready=True)
    loop.turn()
    loop.turn()
    assert end.events == [READ, READ]
    end.near.recv(10)
    loop.turn()
    assert len(end.events) == 2


def test_a_source_that_is_not_ready_is_not_served(loop: VirtualLoop, make: Sources):
    end = make()
    loop.turn()
    assert end.events == []


def test_a_source_is_served_for_what_it_wants(loop: VirtualLoop, make: Sources):
    end = make()
    loop.want(end, READ | WRITE)
    loop.turn()
    end.far.send(b"x")
    loop.turn()
    loop.want(end, READ)
    loop.turn()
    loop.want(end, 0)
    loop.turn()
    assert end.events == [WRITE, READ | WRITE, READ]


def test_a_broken_descriptor_is_reported_although_nobody_asked(loop: VirtualLoop, make: Sources):
    end = make()
    loop.want(end, 0)
    end.far.close()
    loop.turn()
    assert end.events[0] & select.EPOLLHUP


def test_a_source_removed_by_another_in_the_same_turn_is_not_served(loop: VirtualLoop, make: Sources):
    ends: list[End] = []

    def close_the_other(end: End) -> None:
        next(other for other in ends if other is not end).close()

    ends += [make(close_the_other, is_ready=True), make(close_the_other, is_ready=True)]
    loop.turn()
    assert sorted(len(end.events) for end in ends) == [0, 1]


def test_a_source_with_the_number_of_one_closed_in_the_same_turn_is_not_served_for_it(loop: VirtualLoop):
    # The event of the closed descriptor is in the turn's list already: read as the new one's it could be a hang-up.
    flags: list[Flag] = []

    def replace_the_other(flag: Flag) -> None:
        other = flags[1 - flags.index(flag)]
        other.close()
        while (fresh := Flag(loop, 0)).fileno() != other.number:
            fillers.append(fresh)
        flags.append(fresh)

    fillers: list[Flag] = []
    flags += [Flag(loop, 1, replace_the_other), Flag(loop, 1, replace_the_other)]
    loop.turn()
    fresh = flags[2]
    assert [flag.served for flag in flags] in ([1, 0, 0], [0, 1, 0])
    os.eventfd_write(fresh.number, 1)
    loop.turn()
    assert fresh.served == 1
    for flag in (*flags, *fillers):
        flag.close()


def test_a_source_may_remove_itself_while_it_is_served(loop: VirtualLoop, make: Sources):
    end = make(loop.remove, is_ready=True)
    loop.turn()
    loop.turn()
    assert end.events == [READ]


def test_a_source_may_be_added_again_after_it_was_removed(loop: VirtualLoop, make: Sources):
    end = make(is_ready=True)
    loop.remove(end)
    loop.turn()
    loop.add(end)
    loop.turn()
    assert end.events == [READ]


def test_a_source_added_while_another_is_served_has_its_turn_next(loop: VirtualLoop, make: Sources):
    added: list[End] = []

    def add_one(end: End) -> None:
        if not added:
            added.append(make(is_ready=True))

    make(add_one, is_ready=True)
    loop.turn()
    assert added[0].events == []
    loop.turn()
    assert added[0].events == [READ]


def test_removing_what_was_never_added_is_ignored(loop: VirtualLoop):
    stranger = End(loop)
    loop.remove(stranger)
    stranger.close()


def test_removing_a_stranger_with_the_number_of_a_source_leaves_the_source_alone(loop: VirtualLoop, make: Sources):
    class Namesake:
        def fileno(self) -> int:
            return end.fileno()

        def ready(self, events: int) -> None:
            raise AssertionError

    end = make(is_ready=True)
    loop.remove(Namesake())
    loop.turn()
    assert end.events == [READ]


def test_adding_a_source_twice_is_a_bug_and_loud(loop: VirtualLoop, make: Sources):
    end = make()
    with pytest.raises(FileExistsError):
        loop.add(end)


def test_wanting_for_a_source_that_is_not_there_is_a_bug_and_loud(loop: VirtualLoop):
    stranger = End(loop)
    with pytest.raises(FileNotFoundError):
        loop.want(stranger, READ)
    stranger.close()


def test_a_turn_serves_a_bounded_number_of_sources_and_the_next_turn_the_others(loop: VirtualLoop, make: Sources):
    ends = [make(is_ready=True) for _ in range(MAX_EVENTS + 6)]
    loop.turn()
    assert sum(len(end.events) for end in ends) == MAX_EVENTS
    loop.turn()
    assert all(end.events for end in ends)


def test_what_a_source_raises_passes_through_and_the_loop_can_go_on(loop: VirtualLoop, make: Sources):
    def fail(end: End) -> None:
        end.near.recv(10)
        raise ZeroDivisionError

    make(fail, is_ready=True)
    with pytest.raises(ZeroDivisionError):
        loop.run()
    other = make(is_ready=True)
    loop.turn()
    assert other.events == [READ]


# timers


def test_timers_are_served_in_the_order_of_their_moments(loop: VirtualLoop):
    served: list[str] = []
    for delay, name in ((3.0, "c"), (1.0, "a"), (2.0, "b")):
        loop.after(delay, lambda name=name: served.append(f"{name} at {loop.now}"))
    loop.run_for(5.0)
    assert served == ["a at 1001.0", "b at 1002.0", "c at 1003.0"]


def test_timers_of_one_moment_are_served_in_the_order_they_were_set(loop: VirtualLoop):
    served: list[int] = []
    for number in range(20):
        loop.after(1.0, lambda number=number: served.append(number))
    loop.run_for(1.0)
    assert served == list(range(20))


def test_a_timer_is_served_once_and_then_no_longer_pending(loop: VirtualLoop):
    served: list[float] = []
    timer = loop.after(1.0, lambda: served.append(loop.now))
    assert timer.is_pending
    loop.run_for(10.0)
    assert served == [1001.0]
    assert not timer.is_pending


def test_a_cancelled_timer_is_not_served(loop: VirtualLoop):
    timer = loop.after(1.0, lambda: pytest.fail("was cancelled"))
    timer.cancel()
    timer.cancel()
    assert not timer.is_pending
    loop.run_for(2.0)


def test_a_timer_cancelled_by_another_of_the_same_moment_is_not_served(loop: VirtualLoop):
    def cancel_the_second() -> None:
        second.cancel()

    loop.after(1.0, cancel_the_second)
    second = loop.after(1.0, lambda: pytest.fail("was cancelled"))
    loop.run_for(2.0)


def test_a_timer_may_be_cancelled_after_it_was_served(loop: VirtualLoop):
    timer = loop.after(1.0, lambda: None)
    loop.run_for(2.0)
    timer.cancel()


def test_a_timer_may_cancel_itself_while_it_is_served(loop: VirtualLoop):
    served: list[float] = []
    timer = loop.after(1.0, lambda: (timer.cancel(), served.append(loop.now)))
    loop.run_for(2.0)
    assert served == [1001.0]


def test_cancelled_timers_do_not_wake_the_loop(loop: VirtualLoop):
    for _ in range(10):
        loop.after(1.0, lambda: None).cancel()
    assert loop.delay() is None
    loop.after(2.0, lambda: None)
    assert loop.delay() == 2.0


def test_a_timer_that_sets_itself_again_has_one_call_for_each_period(loop: VirtualLoop):
    served: list[float] = []

    def again() -> None:
        served.append(loop.now)
        loop.after(1.0, again)

    again()
    loop.run_for(600.0)
    assert len(served) == 601
    assert served[-1] == 1600.0


def test_a_timer_of_no_delay_set_by_a_timer_waits_for_no_descriptor_but_does_not_hold_them_up(
    loop: VirtualLoop, make: Sources
):
    rounds = 0

    def again() -> None:
        nonlocal rounds
        rounds += 1
        if rounds < 5:
            loop.after(0.0, again)

    end = make(is_ready=True)
    loop.after(0.0, again)
    loop.turn()
    assert end.events == [READ]
    assert rounds == 5
    assert loop.now == 1000.0


def test_late_timers_are_all_served_in_one_turn(loop: VirtualLoop):
    served: list[str] = []
    loop.after(1.0, lambda: served.append("a"))
    loop.after(2.0, lambda: served.append("b"))
    loop.now += 10.0
    assert loop.delay() == 0.0
    loop.turn()
    assert served == ["a", "b"]


def test_a_ready_descriptor_is_served_before_a_due_timer(loop: VirtualLoop, make: Sources):
    order: list[str] = []
    make(lambda end: order.append("descriptor"), is_ready=True)
    loop.after(0.0, lambda: order.append("timer"))
    loop.turn()
    assert order == ["descriptor", "timer"]


def test_what_a_timer_raises_passes_through_and_is_not_called_again(loop: VirtualLoop):
    served: list[str] = []

    def fail() -> None:
        raise ZeroDivisionError

    loop.after(1.0, fail)
    loop.after(1.0, lambda: served.append("the next"))
    with pytest.raises(ZeroDivisionError):
        loop.run()
    loop.turn()
    assert served == ["the next"]


# soon, run and stop


def test_soon_is_served_after_the_descriptors_of_the_turn(loop: VirtualLoop, make: Sources):
    order: list[str] = []
    loop.soon(lambda: order.append("soon"))
    make(lambda end: order.append("descriptor"), is_ready=True)
    loop.turn()
    assert order == ["descriptor", "soon"]


def test_soon_within_soon_waits_for_the_next_turn_so_that_descriptors_come_between(loop: VirtualLoop, make: Sources):
    order: list[str] = []

    def again() -> None:
        order.append("soon")
        loop.soon(again)

    make(lambda end: order.append("descriptor"), is_ready=True)
    loop.soon(again)
    loop.turn()
    loop.turn()
    assert order == ["descriptor", "soon"] * 2


def test_soon_takes_no_time(loop: VirtualLoop):
    loop.after(5.0, lambda: None)
    loop.soon(lambda: None)
    assert loop.delay() == 0.0
    loop.turn()
    assert loop.now == 1000.0


def test_run_turns_until_it_is_stopped_and_can_be_run_again(loop: VirtualLoop):
    served: list[float] = []
    for moment in (1.0, 2.0):
        loop.after(moment, lambda: (served.append(loop.now), loop.stop()))
    loop.run()
    assert served == [1001.0]
    loop.run()
    assert served == [1001.0, 1002.0]


def test_the_turn_in_which_stop_is_called_is_finished(loop: VirtualLoop):
    served: list[str] = []
    loop.after(0.0, loop.stop)
    loop.after(0.0, lambda: served.append("timer"))
    loop.soon(lambda: served.append("soon"))
    loop.run()
    assert served == ["timer", "soon"]


def test_a_loop_on_the_real_clock_wakes_for_its_timer_and_for_its_descriptor():
    loop = Loop()
    order: list[str] = []

    def done(what: str) -> None:
        order.append(what)
        if len(order) == 2:
            loop.stop()

    end = End(loop, lambda end: (loop.remove(end), done("descriptor")))
    loop.add(end)
    loop.after(0.001, lambda: end.far.send(b"x"))
    loop.after(0.002, lambda: done("timer"))
    loop.run()
    end.close()
    loop.close()
    assert sorted(order) == ["descriptor", "timer"]


# the virtual clock itself


def test_the_virtual_clock_stands_while_a_descriptor_is_ready(loop: VirtualLoop, make: Sources):
    end = make(is_ready=True)
    loop.after(1.0, lambda: None)
    for _ in range(3):
        loop.turn()
    assert loop.now == 1000.0
    end.near.recv(10)
    loop.turn()
    assert loop.now == 1001.0


def test_waiting_for_what_never_comes_fails_after_its_virtual_seconds(loop: VirtualLoop):
    with pytest.raises(AssertionError, match=r"not so within 5\.0 virtual seconds"):
        loop.run_until(lambda: False, within=5.0)
    assert loop.now == 1005.0


def test_a_periodic_call_comes_at_once_and_then_each_period():
    with closing(VirtualLoop(now=100.0)) as loop:
        calls = []
        loop.every(1.0, lambda: calls.append(loop.now))
        loop.run_for(3.5)
        assert calls == pytest.approx([100.0, 101.0, 102.0, 103.0])


def test_what_a_pause_has_missed_of_a_periodic_call_is_left_out():
    with closing(VirtualLoop(now=100.0)) as loop:
        calls = []
        loop.every(1.0, lambda: calls.append(loop.now))
        loop.now = 107.3
        loop.run_for(2.0)
        assert calls == pytest.approx([100.0, 107.3, 108.0, 109.0])
