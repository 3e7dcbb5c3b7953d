"""Worker: messages both ways."""

import os
import signal
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from board.runtime.child import BATCH, MAX_MESSAGE, QUEUE
from board.runtime.errors import RequestError
from tests.board.runtime.worker_bench import PROGRAM, Bench, make

__all__ = ["make"]  # a fixture


def test_one_that_ends_while_it_is_brought_has_never_run(make):
    bench = make("unfit")
    bench.worker.start()
    bench.loop.run_until(lambda: bench.states)
    assert [is_up for is_up, _ in bench.states] == [False]
    assert "7" in bench.states[0][1]


def test_messages_go_both_ways_whole_and_in_order(make):
    bench = make("echo")
    bench.up()
    sent = [b"\0", b"a" * MAX_MESSAGE, *(bytes([n]) * (n + 1) for n in range(200))]
    for message in sent:
        assert bench.worker.send(message)
    assert bench.receive(len(sent)) == sent
    assert bench.worker.refused == bench.worker.lost == 0


@pytest.fixture(scope="module")
def echoing() -> Iterator[Bench]:
    bench = Bench("echo", PROGRAM)
    bench.up()
    yield bench
    bench.worker.finish(within=0.0)
    bench.loop.close()


@given(sent=st.lists(st.binary(min_size=1, max_size=2000), max_size=40))
def test_any_octets_come_back_as_they_were(echoing: Bench, sent: list[bytes]):
    echoing.messages.clear()
    for message in sent:
        assert echoing.worker.send(message)
    assert echoing.receive(len(sent)) == sent


@pytest.mark.parametrize("octets", [b"", bytes(MAX_MESSAGE + 1), bytes(10_000_000)], ids=len)
def test_a_message_of_no_or_too_many_octets_is_refused_and_the_next_passes(echoing: Bench, octets: bytes):
    with pytest.raises(RequestError, match=f"message of {len(octets)} octets; 1 to 65536"):
        echoing.worker.send(octets)
    echoing.messages.clear()
    assert echoing.worker.send(b"next")
    assert echoing.receive(1) == [b"next"]


def test_a_message_before_the_child_runs_is_refused_and_counted(make):
    bench = make("echo")
    assert not bench.worker.send(b"early")
    bench.worker.start()
    assert not bench.worker.send(b"early")
    assert bench.worker.refused == 2
    assert not bench.worker.is_up


def test_a_child_that_does_not_read_fills_a_bounded_queue_and_loses_nothing_that_was_taken(make):
    bench = make("deaf")
    pid = bench.up()
    taken = 0
    while bench.worker.send(b"%6d" % taken + bytes(10_000)):
        taken += 1
    assert bench.worker.queued == bench.worker.longest == QUEUE
    assert bench.worker.refused == 1
    assert bench.writable == 0
    os.kill(pid, signal.SIGUSR1)
    assert [int(message[:6]) for message in bench.receive(taken)] == list(range(taken))
    assert bench.writable == 1
    assert bench.worker.queued == bench.worker.lost == 0


def test_what_waited_for_a_child_that_ended_is_counted(make):
    bench = make("deaf")
    pid = bench.up()
    while bench.worker.send(bytes(10_000)):
        pass
    os.kill(pid, signal.SIGKILL)
    bench.down()
    assert bench.worker.lost == QUEUE
    assert bench.worker.longest == QUEUE
    assert bench.worker.queued == 0


def test_a_flood_of_the_child_leaves_room_for_others_in_every_turn(make):
    bench = make("flood")
    bench.up()
    bench.worker.send(b"5000")
    while len(bench.messages) < 5000:
        before = len(bench.messages)
        bench.loop.turn()
        assert len(bench.messages) - before <= BATCH
    assert bench.messages == [str(number).encode() for number in range(5000)]


def test_what_a_child_said_before_it_ended_arrives_before_its_end(make):
    bench = make("flood")
    bench.up()
    bench.on_message = lambda message: bench.messages.append(message) if bench.states[-1][0] else pytest.fail("late")
    bench.worker.send(b"100")
    assert "ended, status 0" in bench.down()
    assert len(bench.messages) == 100
