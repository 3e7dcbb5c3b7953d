"""Worker: stop and finish, the child's surroundings, and the end of its parent."""

import os
import re
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from board.runtime.child import GRACE_S
from board.runtime.echo import try_out
from board.runtime.errors import InterfaceError
from tests.board.runtime.worker_bench import MUTE, PROGRAM, STRANGER, is_gone, make

__all__ = ["make"]  # a fixture


# ends that the parent wants


def test_stop_ends_the_child_and_leaves_neither_zombie_nor_descriptor(make):
    bench = make("echo")
    before = len(os.listdir("/proc/self/fd"))
    pid = bench.up()
    bench.worker.stop()
    assert not bench.worker.is_up
    bench.loop.run_until(lambda: is_gone(pid))
    assert len(os.listdir("/proc/self/fd")) == before
    assert len(bench.states) == 1


def test_stop_kills_a_child_that_stays(make):
    bench = make("stubborn")
    pid = bench.up()
    bench.worker.stop()
    bench.pass_time(GRACE_S)
    bench.loop.run_until(lambda: is_gone(pid))


def test_finish_returns_when_the_child_is_gone_even_one_that_stays(make):
    for name in ("echo", "stubborn"):
        bench = make(name)
        before = len(os.listdir("/proc/self/fd"))
        pid = bench.up()
        bench.worker.finish(within=0.1)
        assert is_gone(pid)
        assert len(os.listdir("/proc/self/fd")) == before


def test_finish_after_stop_sees_the_child_gone(make):
    bench = make("stubborn")
    pid = bench.up()
    bench.worker.stop()
    bench.worker.finish(within=0.1)
    assert is_gone(pid)
    assert bench.loop.delay() is None


def test_stop_and_finish_may_come_at_any_time_and_twice(make):
    bench = make("echo")
    bench.worker.stop()
    bench.worker.finish()
    pid = bench.up()
    bench.worker.stop()
    bench.worker.stop()
    bench.worker.finish()
    bench.worker.finish()
    assert is_gone(pid)


def test_a_worker_that_was_stopped_before_it_ran_says_nothing_any_more(make):
    bench = make("echo")
    bench.worker.start()
    pid = bench.worker._child._process.pid
    bench.worker.stop()
    bench.loop.run_until(lambda: is_gone(pid))
    assert bench.states == []


def test_stop_cancels_a_restart(make):
    bench = make("echo", ["/nowhere/captain"])
    bench.worker.start()
    bench.worker.stop()
    assert bench.loop.delay() is None


def test_a_stopped_worker_can_be_started_again_at_once(make):
    bench = make("echo")
    first = bench.up()
    bench.worker.stop()
    second = bench.up()
    assert second != first
    bench.worker.send(b"x")
    assert bench.receive(1) == [b"x"]
    bench.loop.run_until(lambda: is_gone(first))


def test_start_of_a_started_worker_does_nothing(make):
    bench = make("echo")
    bench.up()
    bench.worker.start()
    bench.worker.send(b"x")
    bench.receive(1)
    assert len(bench.states) == 1


def test_a_worker_may_be_stopped_by_the_message_that_it_passes_on(make):
    bench = make("flood")
    pid = bench.up()
    bench.on_message = lambda message: (bench.messages.append(message), bench.worker.stop())
    bench.worker.send(b"100")
    bench.loop.run_until(lambda: is_gone(pid))
    assert bench.messages == [b"0"]


# the child's surroundings


def test_a_child_inherits_its_socket_and_no_other_descriptor(make):
    with socket.socket() as open_file:
        os.set_inheritable(open_file.fileno(), True)
        bench = make("descriptors")
        bench.up()
        bench.worker.send(b"?")
        mine, _, channel = bench.receive(1)[0].decode().partition(" of ")
    assert mine.split() == sorted(["0", "1", "2", channel])


def test_what_a_child_prints_does_not_mix_with_the_program_s_output(make, capfd):
    bench = make("printer")
    bench.up()
    bench.worker.send(b"from a library")
    bench.receive(1)
    out, err = capfd.readouterr()
    assert out == ""
    assert err == "from a library\n"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_signals_for_the_whole_group_do_not_end_a_child(make, number: int):
    bench = make("echo")
    os.kill(bench.up(), number)
    bench.worker.send(b"still here")
    assert bench.receive(1) == [b"still here"]


def test_a_child_ends_with_its_parent_even_when_that_is_killed(make, wait_for_end):
    bench = make("prove-nesting", [])
    nest = bench.up()
    (state,) = bench.receive(1)
    echo = int(re.findall(rb"state process (\d+) runs", state)[0])
    os.kill(nest, signal.SIGKILL)
    wait_for_end(echo)


def test_a_child_whose_parent_is_gone_already_ends():
    near, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    near.close()
    with far:
        command = [*PROGRAM, "--worker", "stubborn", str(far.fileno())]
        environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[3])}
        ended = subprocess.run(command, pass_fds=[far.fileno()], env=environment, timeout=20, check=False)
    assert ended.returncode == 0


def test_trial_of_the_program_itself_gives_its_time():
    before = len(os.listdir("/proc/self/fd"))
    assert re.search(r" \d+ ms$", try_out())
    assert len(os.listdir("/proc/self/fd")) == before


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ([sys.executable, "-c", MUTE], r"runs but timed out after 0\.01 s"),
        (STRANGER, "is not this program"),
        (["/nowhere/captain"], "cannot be started"),
    ],
)
def test_trying_out_a_program_that_does_not_answer_ends_with_why(command: list[str], words: str):
    with pytest.raises(InterfaceError, match=words):
        try_out(command, patience=0.01)
