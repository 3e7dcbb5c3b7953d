"""Calls to the board's worker: answered, late, crashed, too many, and what becomes of those that wait."""

import errno
import json
import sys
from pathlib import Path

import pytest

from board.board_worker import DEADLINE_S, PATIENCE_S, QUEUE, BoardWorker
from board.runtime.errors import InterfaceError
from drivers.sim.chips import Fault, World
from tests.board.boards import BOARD, make_machine
from tests.said import tells
from tests.virtual import VirtualLoop

PROGRAM = [sys.executable, "-P", str(Path(__file__).with_name("bus_calls_program.py"))]


class Bench:
    """A remote on a loop of its own, and what it told."""

    def __init__(self, root, worker="board-sim"):
        # A child that works answers long before the patience is over: the clock stands unless a test moves it.
        self.loop = VirtualLoop(patience_s=20.0)
        self.machine = make_machine(root)
        self.world = World(BOARD, self.machine)
        self.states = []
        self.answers = {}
        self.worker = BoardWorker(
            self.loop, BOARD, self.machine, worker, lambda *state: self.states.append(state), command=PROGRAM
        )

    def ask(self, key, do, deadline_s=DEADLINE_S, **arguments):
        self.worker.ask(do, arguments, lambda answer: self.answers.setdefault(key, answer), deadline_s)

    def answer(self, key):
        self.loop.run_until(lambda: key in self.answers, within=1000.0)
        return self.answers[key]

    def pass_time(self, seconds):
        self.loop.now += seconds
        self.loop.turn()


@pytest.fixture
def make(tmp_path):
    made = []

    def bench(worker="board-sim"):
        made.append(Bench(tmp_path, worker))
        return made[-1]

    yield bench
    for each in made:
        each.worker.finish(within=0.0)
        each.loop.close()


def test_a_call_is_answered_by_the_worker(make):
    bench = make()
    bench.worker.start()
    bench.ask("rail", "rail", name="pi")
    assert bench.answer("rail") == {"v": 5.1, "a": 0.7, "w": 3.57}
    assert bench.worker.status() == {
        "is_up": True, "why": bench.states[0][1], "restarts": 0, "calls": 1, "failed": 0, "late": 0, "waiting": 0,
        "doing": None,
    }  # fmt: skip
    json.dumps(bench.worker.status())


def test_calls_are_done_in_their_order_one_at_a_time(make):
    bench = make()
    bench.worker.start()
    bench.ask("on", "expander_set", line="modem", active=True)
    bench.ask("is on", "expander_get", line="modem")
    bench.ask("off", "expander_set", line="modem", active=False)
    bench.ask("is off", "expander_get", line="modem")
    bench.answer("is off")
    assert list(bench.answers.items()) == [("on", None), ("is on", True), ("off", None), ("is off", False)]


def test_a_failure_is_an_interface_error_with_the_workers_words(make):
    bench = make()
    bench.world.fail("main", 0x40, Fault())
    bench.worker.start()
    bench.ask("rail", "rail", name="main")
    error = bench.answer("rail")
    assert isinstance(error, InterfaceError)
    assert error.message == "no answer from 0x40 on /dev/i2c-1"
    assert "i2cdetect" in error.hint
    assert bench.worker.failed == 1


def test_call_that_is_late_ends_the_worker_and_those_that_wait_are_done_by_the_next(make):
    bench = make()
    bench.worker.start()
    bench.ask("first", "temperature", name="cpu")
    bench.answer("first")
    bench.world.fail("main", 0x40, Fault(errno.ETIMEDOUT, seconds=600.0))
    bench.ask("stuck", "rail", name="main")
    bench.ask("waiting", "temperature", name="cpu")
    bench.pass_time(DEADLINE_S)
    error = bench.answer("stuck")
    assert tells(error.message, "rail main: ", "timeout", "3 s")
    is_up, why = bench.states[-1]
    assert not is_up
    assert tells(why, "restarts: rail main ", "3 s")
    bench.world.fail("main", 0x40, None)
    assert bench.answer("waiting") == 48.0
    bench.ask("again", "rail", name="main")
    assert bench.answer("again")["v"] == pytest.approx(12.0, abs=0.01)
    assert [is_up for is_up, _ in bench.states] == [True, False, True]
    assert (bench.worker.late, bench.worker.status()["restarts"]) == (1, 1)


def test_the_time_of_a_call_begins_when_the_one_before_it_has_ended(make):
    bench = make()
    bench.worker.start()
    bench.loop.run_until(lambda: bench.worker.is_up)
    bench.world.fail("main", 0x40, Fault(errno.ETIMEDOUT, seconds=600.0))
    bench.ask("stuck", "rail", name="main", deadline_s=5.0)
    bench.ask("short", "temperature", name="cpu", deadline_s=0.5)
    bench.pass_time(5.0)
    assert bench.answer("short") == 48.0
    assert "timeout after 5 s" in bench.answers["stuck"].message


def test_a_worker_that_ends_in_the_middle_of_a_call_fails_that_call_alone(make, caplog):
    bench = make("crash")
    bench.worker.start()
    bench.ask("first", "fan")
    bench.ask("second", "fan")
    error = bench.answer("first")
    assert "fan: the board process: process" in error.message
    assert "status 3" in error.message
    assert "second" not in bench.answers
    bench.pass_time(1.0)  # until the worker is started again
    assert "status 3" in bench.answer("second").message
    # However often it ends, the journal has it once.
    assert [record.levelname for record in caplog.records] == ["WARNING"]


def test_call_that_is_never_begun_is_given_up_with_the_state_of_the_process(make):
    bench = make()  # and not started
    bench.loop.patience_s = 0.0
    bench.ask("fan", "fan")
    bench.loop.run_for(PATIENCE_S - 1)
    assert bench.answers == {}
    bench.loop.run_for(2)
    assert tells(bench.answers["fan"].message, "fan: ", "not started", "30 s: ", "not started")


def test_calls_beyond_the_queue_are_refused_and_never_from_inside_ask(make):
    bench = make()
    for number in range(QUEUE + 1):
        bench.ask(number, "fan")
    assert bench.answers == {}
    bench.loop.turn()
    assert list(bench.answers) == [QUEUE]
    assert tells(bench.answers[QUEUE].message, "fan: ", "queue", "full", "64 calls")
    bench.worker.start()
    assert bench.answer(QUEUE - 1) == {"rpm": 4200, "percent": 50.2}


def test_a_call_may_be_made_from_an_answer(make):
    bench = make()
    bench.worker.start()
    bench.worker.ask("fan", {}, lambda _: bench.ask("second", "temperature", name="cpu"))
    assert bench.answer("second") == 48.0


def test_nobody_is_answered_after_a_stop_and_it_can_be_started_again(make):
    bench = make()
    bench.worker.start()
    for number in range(1 + QUEUE + 1):  # the last one is refused
        bench.ask(number, "fan")
    bench.worker.stop()
    bench.worker.stop()
    bench.loop.turn()
    bench.worker.start()
    bench.ask("after", "fan")
    bench.answer("after")
    assert list(bench.answers) == ["after"]


def test_the_real_worker_runs_without_buses(make):
    bench = make("board")
    bench.worker.start()
    bench.ask("cpu", "temperature", name="cpu")
    assert bench.answer("cpu") == 48.0
