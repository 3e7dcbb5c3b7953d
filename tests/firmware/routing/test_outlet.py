"""The queue towards an interface: what overtakes, what is pushed out, what is too old, and that nothing is lost."""

import math
from contextlib import closing

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.contract import Sent
from drivers.message import Request
from drivers.reason import Reason
from firmware.routing.outlet import BATCH, Outlet
from tests.firmware.doubles import request_of
from tests.virtual import VirtualLoop

DENM, CAM, OTHER = 0, 2, 7


class Air:
    """firmware.routing.outlet.Outgoing: sends as told, and notes what became of each request."""

    def __init__(self, loop: VirtualLoop) -> None:
        self.loop = loop
        self.is_up = True
        self.answer: Sent | None = Sent.NOW
        self.taken: list[Request] = []
        self.left: list[tuple[float, int]] = []
        self.drops: list[tuple[int, Reason]] = []

    def transmit(self, request: Request) -> Sent | None:
        if self.answer is None:
            self.dropped(request, Reason.SEND_FAILED)
        elif self.answer is not Sent.BUSY:
            self.taken.append(request)
        return self.answer

    def sent(self, request: Request, handed_over: float) -> None:
        assert handed_over <= self.loop.now
        self.left.append((self.loop.now, request.number))

    def dropped(self, request: Request, reason: Reason, handed_over: float | None = None, detail: str = "") -> None:
        self.drops.append((request.number, reason))

    @property
    def numbers(self) -> list[int]:
        return [number for _, number in self.left]


class Bench:
    def __init__(self, loop: VirtualLoop, capacity: int = 4, gap_s: float = 0.0) -> None:
        self.loop = loop
        self.air = Air(loop)
        self.outlet = Outlet(loop, self.air, capacity, gap_s)
        self.submitted = 0

    def submit(self, *priorities: int, lifetime: float = math.inf) -> None:
        for priority in priorities:
            self.submitted += 1
            self.outlet.submit(request_of(self.submitted, priority, self.loop.now + lifetime, self.loop.now))

    def busy(self) -> None:
        """Make the driver refuse: one request is offered and waits."""
        self.air.answer = Sent.BUSY

    def free(self) -> None:
        self.air.answer = Sent.NOW
        self.outlet.writable()


@pytest.fixture
def bench(loop: VirtualLoop) -> Bench:
    return Bench(loop)


def test_what_meets_an_idle_interface_leaves_at_once(bench: Bench) -> None:
    bench.submit(CAM, DENM, CAM)
    assert bench.air.numbers == [1, 2, 3]
    assert (bench.outlet.length, bench.outlet.longest) == (0, 0)
    assert bench.outlet.is_empty


def test_a_denm_overtakes_the_cams_that_wait(bench: Bench) -> None:
    bench.busy()
    bench.submit(CAM, CAM, CAM, DENM)
    bench.free()
    assert bench.air.numbers == [4, 1, 2, 3]


def test_requests_of_one_priority_leave_in_the_order_they_came(bench: Bench) -> None:
    bench.busy()
    bench.submit(OTHER, CAM, OTHER, CAM)
    bench.free()
    assert bench.air.numbers == [2, 4, 1, 3]


def test_a_full_queue_pushes_out_the_oldest_of_the_lowest_priority(bench: Bench) -> None:
    bench.busy()
    bench.submit(DENM, OTHER, OTHER, CAM)
    bench.submit(CAM)
    assert bench.air.drops == [(2, Reason.QUEUE_FULL)]
    bench.submit(DENM)
    assert bench.air.drops[1:] == [(3, Reason.QUEUE_FULL)]
    assert bench.outlet.length == 4


def test_a_full_queue_of_one_priority_pushes_out_its_oldest(bench: Bench) -> None:
    bench.busy()
    bench.submit(CAM, CAM, CAM, CAM, CAM)
    assert bench.air.drops == [(1, Reason.QUEUE_FULL)]
    bench.free()
    assert bench.air.numbers == [2, 3, 4, 5]


def test_what_is_less_urgent_than_all_that_wait_is_itself_refused(bench: Bench) -> None:
    bench.busy()
    bench.submit(DENM, DENM, CAM, CAM)
    bench.submit(OTHER)
    assert bench.air.drops == [(5, Reason.QUEUE_FULL)]
    bench.free()
    assert bench.air.numbers == [1, 2, 3, 4]


def test_a_flood_of_cams_pushes_out_no_denm(bench: Bench) -> None:
    bench.busy()
    bench.submit(DENM, *[CAM] * 1000)
    assert 1 not in [number for number, _ in bench.air.drops]
    assert len(bench.air.drops) == 997
    bench.free()
    assert bench.air.numbers[0] == 1


def test_a_long_queue_leaves_a_batch_a_turn_in_its_order(loop: VirtualLoop) -> None:
    bench = Bench(loop, capacity=1000)
    bench.busy()
    bench.submit(*[CAM] * 1000)
    bench.free()
    assert bench.air.numbers == list(range(1, BATCH + 1))
    bench.outlet.writable()
    loop.turn()
    assert BATCH < len(bench.air.numbers) <= 3 * BATCH
    loop.run_for(0.1)
    assert bench.air.numbers == list(range(1, 1001))
    assert bench.outlet.is_empty


def test_the_longest_that_it_was_is_remembered(bench: Bench) -> None:
    bench.busy()
    bench.submit(CAM, CAM, CAM)
    bench.free()
    assert (bench.outlet.length, bench.outlet.longest) == (0, 3)


def test_what_is_older_than_its_lifetime_is_not_sent(bench: Bench) -> None:
    bench.busy()
    bench.submit(CAM, lifetime=0.05)
    bench.submit(CAM, lifetime=10)
    bench.loop.run_for(0.06)
    bench.free()
    assert bench.air.drops == [(1, Reason.EXPIRED)]
    assert bench.air.numbers == [2]


def test_what_may_live_until_now_is_still_sent(bench: Bench) -> None:
    bench.submit(CAM, lifetime=0.0)
    assert bench.air.numbers == [1]


def test_what_grows_too_old_while_nothing_moves_is_given_up_without_a_push(bench: Bench) -> None:
    bench.busy()
    bench.submit(CAM, lifetime=0.5)
    bench.submit(DENM, lifetime=1.0)
    bench.loop.run_for(0.8)
    assert bench.air.drops == [(1, Reason.EXPIRED)]
    bench.loop.run_for(0.5)
    assert bench.air.drops == [(1, Reason.EXPIRED), (2, Reason.EXPIRED)]
    assert bench.outlet.is_empty


def test_giving_up_the_old_keeps_the_order_of_the_others(bench: Bench) -> None:
    bench.busy()
    bench.submit(CAM, lifetime=10)
    bench.submit(CAM, lifetime=0.1)
    bench.submit(CAM, lifetime=10)
    bench.loop.run_for(1)
    bench.free()
    assert bench.air.numbers == [1, 3]


def test_an_empty_queue_leaves_no_timer_behind(bench: Bench) -> None:
    bench.busy()
    bench.submit(CAM, lifetime=0.1)
    bench.loop.run_for(1)
    assert bench.loop.delay() is None


def test_what_waits_for_a_link_that_stays_down_is_dropped_for_that(bench: Bench) -> None:
    bench.air.is_up = False
    bench.submit(CAM, lifetime=1.0)
    bench.loop.run_for(2)
    assert bench.air.drops == [(1, Reason.LINK_DOWN)]


def test_a_link_that_comes_back_in_time_carries_what_waited_most_urgent_first(bench: Bench) -> None:
    bench.air.is_up = False
    bench.submit(CAM, DENM, lifetime=5.0)
    bench.loop.run_for(2)
    assert bench.air.numbers == []
    bench.air.is_up = True
    bench.outlet.writable()
    assert bench.air.numbers == [2, 1]


def test_writable_while_the_link_is_down_sends_nothing(bench: Bench) -> None:
    bench.air.is_up = False
    bench.submit(CAM)
    bench.outlet.writable()
    assert bench.air.numbers == []


def test_a_busy_driver_is_not_asked_again_before_it_says_so(bench: Bench) -> None:
    bench.busy()
    bench.submit(CAM)
    bench.air.answer = Sent.NOW
    bench.submit(DENM)
    bench.loop.run_for(5)
    assert bench.air.numbers == []
    bench.outlet.writable()
    assert bench.air.numbers == [2, 1]


def test_what_a_busy_driver_refused_goes_back_to_the_front(bench: Bench) -> None:
    bench.busy()
    bench.submit(CAM, CAM, CAM)
    bench.outlet.writable()  # still busy: the first is offered and refused again
    bench.free()
    assert bench.air.numbers == [1, 2, 3]


def test_writable_again_and_again_sends_nothing_twice(bench: Bench) -> None:
    bench.busy()
    bench.submit(CAM)
    bench.free()
    bench.outlet.writable()
    assert bench.air.numbers == [1]


def test_what_the_driver_keeps_is_sent_when_it_says_so(bench: Bench) -> None:
    bench.air.answer = Sent.LATER
    bench.submit(CAM)
    assert bench.air.numbers == []
    assert not bench.outlet.is_empty
    bench.outlet.confirm(bench.air.taken[0], None)
    assert bench.air.numbers == [1]
    assert bench.outlet.is_empty


def test_what_the_driver_keeps_and_loses_is_dropped_with_its_reason(bench: Bench) -> None:
    bench.air.answer = Sent.LATER
    bench.submit(CAM)
    bench.outlet.confirm(bench.air.taken[0], Reason.SEND_FAILED)
    assert bench.air.drops == [(1, Reason.SEND_FAILED)]


def test_a_second_confirm_of_one_request_is_ignored(bench: Bench) -> None:
    bench.air.answer = Sent.LATER
    bench.submit(CAM)
    for _ in range(3):
        bench.outlet.confirm(bench.air.taken[0], None)
    assert bench.air.numbers == [1]


def test_a_confirm_of_what_was_never_handed_over_is_ignored(bench: Bench) -> None:
    bench.outlet.confirm(request_of(99), None)
    bench.outlet.confirm(request_of(99), Reason.SEND_FAILED)
    assert (bench.air.numbers, bench.air.drops) == ([], [])


def test_a_driver_that_stops_loses_what_it_kept_and_the_rest_waits(bench: Bench) -> None:
    bench.air.answer = Sent.LATER
    bench.submit(CAM, CAM)
    bench.busy()
    bench.submit(CAM)
    bench.outlet.drop_kept(Reason.SEND_FAILED)
    assert bench.air.drops == [(1, Reason.SEND_FAILED), (2, Reason.SEND_FAILED)]
    bench.free()
    assert bench.air.numbers == [3]


def test_a_confirm_after_the_driver_stopped_changes_nothing(bench: Bench) -> None:
    bench.air.answer = Sent.LATER
    bench.submit(CAM)
    bench.outlet.drop_kept(Reason.SEND_FAILED)
    bench.outlet.confirm(bench.air.taken[0], None)
    assert (bench.air.numbers, bench.air.drops) == ([], [(1, Reason.SEND_FAILED)])


def test_the_end_of_the_station_gives_up_all_that_waits_or_is_kept(bench: Bench) -> None:
    bench.air.answer = Sent.LATER
    bench.submit(CAM)
    bench.busy()
    bench.submit(CAM, DENM)
    bench.outlet.drop_all(Reason.STOPPED)
    assert sorted(bench.air.drops) == [(1, Reason.STOPPED), (2, Reason.STOPPED), (3, Reason.STOPPED)]
    assert bench.outlet.is_empty
    bench.free()
    bench.loop.run_for(1)
    assert bench.air.numbers == []


def test_what_the_driver_can_never_send_stops_nothing_behind_it(bench: Bench) -> None:
    bench.busy()
    bench.submit(CAM, CAM)
    bench.air.answer = None
    bench.outlet.writable()
    assert bench.air.drops == [(1, Reason.SEND_FAILED), (2, Reason.SEND_FAILED)]
    bench.air.answer = Sent.NOW
    bench.submit(CAM)
    assert bench.air.numbers == [3]


def test_a_paced_queue_keeps_the_gap_between_all_that_leave(loop: VirtualLoop) -> None:
    bench = Bench(loop, capacity=10, gap_s=0.1)
    bench.submit(CAM, CAM, CAM, CAM)
    loop.run_for(1)
    moments = [moment for moment, _ in bench.air.left]
    assert moments == pytest.approx([1000.0, 1000.1, 1000.2, 1000.3], abs=0.003)


def test_a_pause_earns_no_burst(loop: VirtualLoop) -> None:
    bench = Bench(loop, capacity=10, gap_s=0.1)
    bench.submit(CAM)
    loop.run_for(60)
    bench.submit(CAM, CAM, CAM)
    loop.run_for(1)
    moments = [moment for moment, _ in bench.air.left]
    assert moments[1:] == pytest.approx([1060.0, 1060.1, 1060.2], abs=0.003)


def test_a_timer_that_comes_late_costs_the_pace_nothing(loop: VirtualLoop) -> None:
    bench = Bench(loop, capacity=2000, gap_s=0.0001)
    bench.submit(*[CAM] * 1000)
    while bench.outlet.length:  # a timer of epoll has the grain of a millisecond
        loop.now += 0.001
        loop.turn()
    assert loop.now - 1000.0 == pytest.approx(0.1, abs=0.01)


def test_a_denm_overtakes_in_a_paced_queue_too(loop: VirtualLoop) -> None:
    bench = Bench(loop, capacity=10, gap_s=0.1)
    bench.submit(CAM, CAM, CAM, DENM)
    loop.run_for(1)
    assert bench.air.numbers == [1, 4, 2, 3]


def test_a_paced_queue_forgets_its_pace_over_nothing_that_expires(loop: VirtualLoop) -> None:
    bench = Bench(loop, capacity=10, gap_s=0.5)
    bench.submit(CAM, lifetime=10)
    bench.submit(CAM, lifetime=0.1)
    bench.submit(CAM, lifetime=10)
    loop.run_for(2)
    assert bench.air.numbers == [1, 3]
    assert bench.air.drops == [(2, Reason.EXPIRED)]


OPERATIONS = st.one_of(
    st.tuples(st.just("submit"), st.integers(0, 7), st.sampled_from([0.0, 0.1, 0.5, 30.0])),
    st.tuples(st.just("answer"), st.sampled_from([Sent.NOW, Sent.LATER, Sent.BUSY, None]), st.none()),
    st.tuples(st.just("wait"), st.sampled_from([0.0, 0.05, 0.3, 2.0]), st.none()),
    st.tuples(st.just("link"), st.booleans(), st.none()),
    st.tuples(st.just("writable"), st.none(), st.none()),
    st.tuples(st.just("confirm"), st.integers(0, 5), st.sampled_from([None, Reason.SEND_FAILED])),
    st.tuples(st.just("drop_kept"), st.none(), st.none()),
    st.tuples(st.just("drop_all"), st.none(), st.none()),
)


def act(bench: Bench, operation: tuple[object, ...]) -> None:
    what, first, second = operation
    air, outlet = bench.air, bench.outlet
    match what:
        case "submit":
            bench.submit(first, lifetime=second)
        case "answer":
            air.answer = first
        case "wait":
            bench.loop.run_for(first)
        case "link":
            air.is_up = first
            if first:
                outlet.writable()
        case "writable":
            outlet.writable()
        case "confirm" if first < len(air.taken):
            outlet.confirm(air.taken[first], second)
        case "drop_kept":
            outlet.drop_kept(Reason.SEND_FAILED)
        case "drop_all":
            outlet.drop_all(Reason.STOPPED)


@given(st.lists(OPERATIONS, max_size=40), st.sampled_from([1, 3, 100]), st.sampled_from([0.0, 0.25]))
@settings(max_examples=300)
def test_nothing_is_ever_lost_or_counted_twice(operations: list, capacity: int, gap_s: float) -> None:
    with closing(VirtualLoop()) as loop:
        bench = Bench(loop, capacity, gap_s)
        for operation in operations:
            act(bench, operation)
            ended = bench.air.numbers + [number for number, _ in bench.air.drops]
            assert len(ended) == len(set(ended))
            assert bench.submitted == len(ended) + bench.outlet.length + len(bench.outlet._kept)
            assert bench.outlet.length == sum(map(len, bench.outlet._queues)) <= capacity
        bench.outlet.drop_all(Reason.STOPPED)
        ended = bench.air.numbers + [number for number, _ in bench.air.drops]
        assert sorted(ended) == list(range(1, bench.submitted + 1))
