"""Runner of scripts: executes yielded steps; limits, wakes, interrupts and stops them."""

import pytest

from board.runtime.errors import StationError
from drivers.sim8202g.script import LEAST_PAUSE_S, Ask, Begin, Ended, Pause, Run, Runner, StepError, ask, run
from drivers.wire.at.forms import SILENT, Final
from drivers.wire.at.port import Answer
from tests.said import tells

PATIENCE_S = 0.0  # nothing here crosses the kernel's threads
OK = Final("OK")


class World:
    """World that answers each question one second later."""

    def __init__(self, loop):
        self.loop = loop
        self.steps = []
        self.final = OK
        self.stopped = 0

    def ask(self, command, done):
        self.loop.after(1.0, lambda: done(Answer(1, command, self.final)))

    def run(self, run, done):
        self.loop.after(1.0, lambda: done(Ended(len(run.argv) - 1, "said\nlast")))
        return self

    def stop(self):
        self.stopped += 1

    def begun(self, step):
        self.steps.append(step)

    @property
    def why(self):
        return self.steps[-1]


@pytest.fixture
def world(loop):
    return World(loop)


def started(loop, world, script):
    errors = []
    runner = Runner(loop, world, script, errors.append)
    runner.start()
    return runner, errors


def test_a_script_is_resumed_with_what_it_waited_for(loop, world):
    seen = []

    def script():
        yield Begin("first", 10.0)
        seen.append((yield from ask("AT")).final)
        yield Pause(2.0)
        seen.append((yield from run("true")))
        seen.append(loop.now)

    began = loop.now
    _, errors = started(loop, world, script())
    loop.run_for(10)
    assert (seen, errors, world.steps) == ([OK, "said\nlast", began + 4.0], [], ["first"])
    assert loop.delay() is None


def test_a_step_that_takes_too_long_fails_in_itself(loop, world):
    def script():
        yield Begin("slow", 5.0)
        yield Pause(100.0)

    _, errors = started(loop, world, script())
    loop.run_for(10)
    assert [str(error) for error in errors] == ["slow: not done within 5 s"]


def test_the_limit_is_that_of_one_step(loop, world):
    def script():
        for step in range(10):
            yield Begin(str(step), 5.0)
            yield Pause(4.0)
        yield Begin("last", None)
        yield Pause(1000.0)

    _, errors = started(loop, world, script())
    loop.run_for(2000)
    assert (errors, len(world.steps)) == ([], 11)


def test_a_pause_is_woken_but_not_before_its_least(loop, world):
    woken = []

    def script():
        while True:
            yield Pause(100.0, wakes=True)
            woken.append(loop.now)

    began = loop.now
    runner, _ = started(loop, world, script())
    for _ in range(100):
        runner.wake()
        loop.run_for(0.1)
    assert woken == pytest.approx([began + LEAST_PAUSE_S * count for count in range(1, len(woken) + 1)])
    assert 9 <= len(woken) <= 10
    runner.stop()


def test_a_pause_that_does_not_wake_is_not_woken(loop, world):
    def script():
        yield Pause(5.0)

    runner, _ = started(loop, world, script())
    runner.wake()
    loop.run_for(4)
    assert loop.delay() is not None
    runner.stop()


def test_a_program_that_fails_raises_with_its_last_words_and_is_stopped_by_an_interruption(loop, world):
    def script():
        try:
            yield from run("false", "x")
        except StepError as error:
            assert tells(str(error), "false ", "status 1: last")
        yield Run(("sleep",), 5.0)

    runner, errors = started(loop, world, script())
    loop.run_for(1.5)
    runner.interrupt(StationError("enough"))
    assert (world.stopped, [str(error) for error in errors]) == (1, ["enough"])
    loop.run_for(5)  # later answers must be ignored


def test_a_silent_modem_is_an_error_and_a_refusal_an_answer(loop, world):
    seen = []

    def script():
        world.final = Final("ERROR")
        seen.append((yield from ask("AT")).final.name)
        world.final = SILENT
        yield from ask("AT")

    _, errors = started(loop, world, script())
    loop.run_for(5)
    assert seen == ["ERROR"]
    assert "answers no AT" in errors[0].message


def test_a_world_that_refuses_is_an_error_where_it_was_asked(loop, world):
    def refuse(command, done):
        raise StepError("closed")

    world.ask = refuse
    seen = []

    def script():
        try:
            yield Ask(None)
        except StepError as error:
            seen.append(error.message)

    started(loop, world, script())
    assert seen == ["closed"]


def test_stopped_it_does_nothing_more(loop, world):
    seen = []

    def script():
        try:
            yield Begin("step", 5.0)
            yield from ask("AT")
        finally:
            seen.append("left")

    runner, errors = started(loop, world, script())
    runner.stop()
    runner.wake()
    loop.run_for(10)
    assert (seen, errors) == (["left"], [])
