"""Workers: messages both ways, and every way in which a child or its parent can end."""

import os
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from board.runtime import worker
from board.runtime.child import BATCH, GRACE_S, MAX_MESSAGE, QUEUE, START_S
from board.runtime.echo import try_out
from board.runtime.errors import InterfaceError, RequestError
from board.runtime.worker import STEADY_S, Worker
from tests.virtual import VirtualLoop

PROGRAM = [sys.executable, "-P", str(Path(__file__).with_name("worker_program.py"))]
SLEEPER = [sys.executable, "-c", "import time; time.sleep(60)"]
STRANGER = [sys.executable, "-c", "import socket, sys; socket.socket(fileno=int(sys.argv[3])).send(b'what?')"]
MUTE = "import socket, sys; end = socket.socket(fileno=int(sys.argv[3])); end.send(b'hello'); end.recv(9); end.recv(9)"


class Bench:
    """A worker on a loop of its own, and what it told."""

    def __init__(self, name: str, command: list[str], silence_s: float = 0.0) -> None:
        # A child that works answers long before the patience is over: the clock stands unless a test moves it.
        self.loop = VirtualLoop(patience_s=20.0)
        self.messages: list[bytes] = []
        self.states: list[tuple[bool, str]] = []
        self.writable = 0
        self.on_message: Callable[[bytes], None] = self.messages.append
        self.worker = Worker(
            self.loop,
            name,
            on_message=self._note,
            on_state=lambda is_up, why: self.states.append((is_up, why)),
            on_writable=self._count,
            command=command,
            silence_s=silence_s,
        )

    def _note(self, message: bytes) -> None:
        self.on_message(message)  # which a test may have changed

    def _count(self) -> None:
        self.writable += 1

    def up(self) -> int:
        """Start, wait until it runs; returns its process id."""
        before = len(self.states)
        self.worker.start()
        self.loop.run_until(lambda: len(self.states) > before)
        is_up, why = self.states[-1]
        assert is_up, why
        return int(re.findall(r"process (\d+) runs", why)[0])

    def down(self) -> str:
        """Wait until it has ended; returns why."""
        self.loop.run_until(lambda: not self.states[-1][0])
        return self.states[-1][1]

    def pass_time(self, seconds: float) -> None:
        self.loop.now += seconds
        self.loop.turn()

    def receive(self, count: int) -> list[bytes]:
        self.loop.run_until(lambda: len(self.messages) >= count)
        return self.messages


@pytest.fixture
def make(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Bench]]:
    monkeypatch.setattr(worker, "jitter", lambda: 1.0)
    made: list[Bench] = []

    def bench(name: str, command: list[str] = PROGRAM, silence_s: float = 0.0) -> Bench:
        made.append(Bench(name, command, silence_s))
        return made[-1]

    yield bench
    for each in made:
        each.worker.finish(within=0.0)
        each.loop.close()


def is_gone(pid: int) -> bool:
    """Ended, and no zombie of ours."""
    return not Path(f"/proc/{pid}").exists()


# messages


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


# ends of the child


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


def test_a_child_that_does_not_run_in_time_is_killed(make):
    bench = make("echo", SLEEPER)
    bench.worker.start()
    bench.pass_time(START_S)
    bench.loop.run_until(lambda: len(bench.states) > 0)
    assert f"did not start within {START_S:.0f} s, SIGKILL" in bench.down()


def test_a_program_that_is_not_ours_is_killed(make):
    bench = make("echo", STRANGER)
    bench.worker.start()
    bench.loop.run_until(lambda: len(bench.states) > 0)
    assert "unexpected first message" in bench.down()


def test_a_child_that_sends_too_long_a_message_is_killed(make):
    bench = make("long")
    bench.up()
    assert "sent a message of more than 65536 octets, SIGKILL" in bench.down()
    assert bench.messages == []


def test_a_child_that_closes_its_socket_and_stays_is_killed(make):
    bench = make("closer")
    pid = bench.up()
    bench.loop.run_until(lambda: not bench.worker.is_up)
    assert not bench.worker.send(b"x")
    bench.pass_time(GRACE_S)
    assert "closed its socket but did not exit in time, SIGKILL" in bench.down()
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


def test_restarts_come_ever_later_up_to_half_a_minute(make):
    bench = make("echo", ["/nowhere/captain"])
    bench.worker.start()
    for _ in range(9):
        bench.pass_time(30.0)
    delays = [re.sub(r".* in ", "", why) for _, why in bench.states]
    assert bench.states[0] == (False, "cannot be started: No such file or directory; starts again in 0.2 s")
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


def test_trying_out_the_program_itself_says_how_long_it_took():
    before = len(os.listdir("/proc/self/fd"))
    assert re.fullmatch(r"a child process answered after \d+ ms", try_out())
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
