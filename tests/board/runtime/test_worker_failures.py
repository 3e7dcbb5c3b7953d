"""Worker: every way in which a child fails, and its restarts."""

import errno
import os
import re
import signal

import pytest

from board.runtime import worker
from board.runtime.child import GRACE_S, START_S
from board.runtime.worker import STEADY_S
from tests.board.runtime.worker_bench import SLEEPER, STRANGER, is_gone, make
from tests.said import tells

__all__ = ["make"]  # a fixture


def test_a_child_that_ends_is_explained_and_started_again(make):
    bench = make("crash")
    first = bench.up()
    bench.worker.send(b"3")
    assert bench.down() == f"process {first} ended, status 3; starts again in 0.2 s"
    assert is_gone(first)
    assert not bench.worker.is_up
    bench.pass_time(0.2)
    bench.loop.run_until(lambda: bench.worker.is_up)
    assert bench.worker.restarts == 1


@pytest.mark.parametrize("number", [signal.SIGSEGV, signal.SIGKILL, signal.SIGRTMIN + 1])
def test_the_signal_that_ended_a_child_is_named(make, number: int):
    bench = make("echo")
    pid = bench.up()
    os.kill(pid, number)
    name = signal.Signals(number).name if number < signal.SIGRTMIN else f"signal {number}"
    assert bench.down() == f"process {pid} ended, {name}; starts again in 0.2 s"


def test_an_exception_in_a_child_ends_it_with_its_traceback_on_stderr(make, capfd):
    bench = make("fail")
    bench.up()
    assert "status 1" in bench.down()
    assert "ZeroDivisionError" in capfd.readouterr().err


def test_a_name_that_the_program_does_not_know_is_a_failure_that_says_so(make, capfd):
    bench = make("nobody")
    bench.worker.start()
    bench.loop.run_until(lambda: len(bench.states) > 0)
    assert "status 2" in bench.down()
    assert "--worker is internal" in capfd.readouterr().err


def test_child_that_does_not_run_in_time_is_killed(make):
    bench = make("echo", SLEEPER)
    bench.worker.start()
    bench.pass_time(START_S)
    bench.loop.run_until(lambda: len(bench.states) > 0)
    assert tells(bench.down(), "not start", f"{START_S:.0f} s", "SIGKILL")


def test_a_program_that_is_not_ours_is_killed(make):
    bench = make("echo", STRANGER)
    bench.worker.start()
    bench.loop.run_until(lambda: len(bench.states) > 0)
    assert "unexpected first message" in bench.down()


def test_child_that_sends_too_long_a_message_is_killed(make):
    bench = make("long")
    bench.up()
    assert tells(bench.down(), "message", "65536 octets", "SIGKILL")
    assert bench.messages == []


def test_child_that_closes_its_socket_and_stays_is_killed(make):
    bench = make("closer")
    pid = bench.up()
    bench.loop.run_until(lambda: not bench.worker.is_up)
    assert not bench.worker.send(b"x")
    bench.pass_time(GRACE_S)
    assert tells(bench.down(), "closed its socket", "not exit", "SIGKILL")
    assert is_gone(pid)


def test_a_child_that_is_frozen_is_killed_and_started_again(make):
    bench = make("echo", silence_s=5.0)
    pid = bench.up()
    os.kill(pid, signal.SIGSTOP)
    for _ in range(6):
        assert bench.worker.is_up
        bench.loop.now += 1.0
        bench.loop.turn()
    assert bench.down() == f"process {pid} was silent for 5 s, SIGKILL; starts again in 0.2 s"
    assert is_gone(pid)


def test_a_child_that_says_something_now_and_then_stays(make):
    bench = make("echo", silence_s=5.0)
    bench.up()
    for count in range(1, 5):
        for _ in range(4):
            bench.loop.now += 1.0
            bench.loop._serve_timers()
        bench.worker.send(b"x")
        bench.receive(count)
    assert len(bench.states) == 1


def test_a_pause_of_the_program_itself_is_no_silence_of_its_child(make):
    bench = make("echo", silence_s=5.0)
    bench.up()
    for _ in range(2):
        bench.loop.now += 600.0
        bench.loop._serve_timers()
    bench.worker.send(b"x")
    assert bench.receive(1) == [b"x"]
    assert len(bench.states) == 1


def test_restarts_of_a_child_that_cannot_start_come_ever_later_up_to_half_a_minute(make):
    bench = make("echo", ["/nowhere/captain"])
    bench.worker.start()
    for _ in range(9):
        bench.pass_time(30.0)
    delays = [re.sub(r".* in ", "", why) for _, why in bench.states]
    is_up, why = bench.states[0]
    assert not is_up
    assert tells(why, "started: ", f"{os.strerror(errno.ENOENT)}; ", "0.2 s")
    assert delays == [f"{s} s" for s in ("0.2", "0.4", "0.8", "1.6", "3.2", "6.4", "12.8", "25.6", "30.0", "30.0")]
    assert bench.worker.restarts == 10


def test_restarts_are_spread_over_half_of_their_delay(make, monkeypatch):
    bench = make("echo", ["/nowhere/captain"])
    monkeypatch.setattr(worker, "jitter", lambda: 0.0)
    bench.worker.start()
    assert bench.states[0][1].endswith("starts again in 0.1 s")


def test_a_child_that_ran_for_long_is_started_again_soon(make):
    bench = make("crash")
    bench.up()
    delays = []
    for seconds in (0.0, 0.0, STEADY_S, 0.0):
        bench.loop.run_until(lambda: bench.worker.is_up)
        bench.loop.now += seconds
        bench.worker.send(b"0")
        delays.append(bench.down()[-5:])
        bench.pass_time(1.0)
    assert delays == ["0.2 s", "0.4 s", "0.2 s", "0.4 s"]
