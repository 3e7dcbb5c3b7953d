"""Scripts of a modem as generators: a script yields each operation that it waits for.

    def attach() -> Script[None]:
        yield Begin("attach")
        answer = yield from ask("AT+CGATT?")

The Runner executes each yielded operation on the loop, and resumes the generator with its result. Nothing blocks.
"""

from collections.abc import Callable, Generator
from typing import Any, NamedTuple, Protocol, TypeAlias, TypeVar

from board.runtime.errors import BlockedError, InterfaceError, StationError
from board.runtime.loop import Loop, Timer
from drivers.wire.at.forms import SILENT, Command, Final, command
from drivers.wire.at.port import Answer
from drivers.wire.redact import redact

T = TypeVar("T")

# Texts of EPERM and EACCES in the output of programs.
_NOT_PERMITTED = ("Operation not permitted", "Permission denied")
NEEDS = "a bearer needs the right to configure network devices: CAP_NET_ADMIN"

LEAST_PAUSE_S = 1.0  # least length of a pause that is woken, so that many unsolicited lines do not cause many questions


class Begin(NamedTuple):
    """Start of a step, which fails after limit_s; None: no time limit."""

    step: str
    limit_s: float | None


class Ask(NamedTuple):
    """Operation that sends an AT command; the script resumes with its Answer."""

    command: Command


class Pause(NamedTuple):
    """Operation that waits for a time; with `wakes`, Runner.wake() ends it early."""

    seconds: float
    wakes: bool = False


class Run(NamedTuple):
    """Operation that runs a program; the script resumes with its Ended.

    argv     command line.
    limit_s  time limit.
    keep     regular expression: when the program's output has it, the script resumes, and the program keeps running.
             Empty: the script resumes when the program has ended.
    """

    argv: tuple[str, ...]
    limit_s: float
    keep: str = ""


class Ended(NamedTuple):
    """Result of a program.

    status  exit status; None if the program was kept and still runs.
    output  its output so far.
    """

    status: int | None
    output: str


Effect: TypeAlias = Begin | Ask | Pause | Run
Script: TypeAlias = Generator[Effect, Any, T]


class StepError(InterfaceError):
    """A step failed, which starts recovery."""


class NoAnswerError(StepError):
    """The modem does not answer AT commands at all."""


class LostError(StepError):
    """The network or the bearer was lost after it was up. The driver connects again before it resets anything."""


class Program(Protocol):
    """A running program."""

    def stop(self) -> None: ...


class World(Protocol):
    """Environment of a Runner: it sends commands, runs programs, and takes note of steps.

    why    current step and what it waits for, in words; used in the error if the step exceeds its time limit.
    ask    sends an AT command, and calls done() with its answer.
    run    starts a program, and calls done() with its result or an error.
    begun  takes note of the start of a step.
    """

    @property
    def why(self) -> str: ...
    def ask(self, command: Command, done: Callable[[Answer], None]) -> None: ...
    def run(self, run: Run, done: Callable[[Ended | StationError], None]) -> Program: ...
    def begun(self, step: str) -> None: ...


class Runner:
    """Runs one script; done is called with a StationError that ends it."""

    def __init__(self, loop: Loop, world: World, script: Script[None], done: Callable[[StationError], None]) -> None:
        self._loop = loop
        self._world = world
        self._script = script
        self._done = done
        self._turn = 0  # number of the script's current operation; results of earlier operations are ignored
        self._limit: Timer | None = None
        self._pause: Timer | None = None
        self._woken_from: float | None = None  # earliest time at which wake() may end the current pause
        self._program: Program | None = None

    def start(self) -> None:
        """Run the script to its first operation."""
        self._resume(lambda: next(self._script))

    def wake(self) -> None:
        """End the current pause if it has `wakes`, but not before LEAST_PAUSE_S from its start."""
        if self._woken_from is not None and self._pause is not None:
            self._pause.cancel()
            self._pause = self._after(self._woken_from - self._loop.clock())
            self._woken_from = None

    def interrupt(self, error: StationError) -> None:
        """Cancel the current operation, and raise an error in the script in its place."""
        self._leave()
        self._resume(lambda: self._script.throw(error))

    def stop(self) -> None:
        """End the script at its current operation."""
        self._leave()
        if self._limit is not None:
            self._limit.cancel()
        self._script.close()

    def _resume(self, advance: Callable[[], Effect]) -> None:
        """Resume the script by `advance`, and start its next operation."""
        try:
            effect = advance()
            while isinstance(effect, Begin):
                self._begin(effect)
                effect = next(self._script)
            self._do(effect)
        except StopIteration:
            self._end()
        except StationError as error:
            self._end()
            self._done(error)

    def _begin(self, begin: Begin) -> None:
        self._end()
        if begin.limit_s is not None:
            self._limit = self._loop.after(begin.limit_s, lambda: self._late(begin))
        self._world.begun(begin.step)

    def _do(self, effect: Effect) -> None:
        turn = self._turn
        try:
            if isinstance(effect, Ask):
                self._world.ask(effect.command, lambda answer: self._result(turn, answer))
            elif isinstance(effect, Run):
                self._program = self._world.run(effect, lambda ended: self._result(turn, ended))
            elif isinstance(effect, Pause):
                self._woken_from = self._loop.clock() + min(LEAST_PAUSE_S, effect.seconds) if effect.wakes else None
                self._pause = self._after(effect.seconds)
        except StationError as error:
            self.interrupt(error)

    def _after(self, seconds: float) -> Timer:
        turn = self._turn
        return self._loop.after(max(0.0, seconds), lambda: self._result(turn, None))

    def _result(self, turn: int, result: object) -> None:
        if turn != self._turn:
            return
        self._program = None  # the program has ended, or World keeps it
        self._leave()
        if isinstance(result, StationError):
            self._resume(lambda: self._script.throw(result))
        else:
            self._resume(lambda: self._script.send(result))

    def _late(self, begin: Begin) -> None:
        self._limit = None
        self.interrupt(StepError(f"{self._world.why}: not done within {begin.limit_s:.0f} s"))

    def _leave(self) -> None:
        """Cancel the current operation; its result will be ignored."""
        self._turn += 1
        self._woken_from = None
        if self._pause is not None:
            self._pause.cancel()
            self._pause = None
        if self._program is not None:
            self._program.stop()
            self._program = None

    def _end(self) -> None:
        if self._limit is not None:
            self._limit.cancel()
            self._limit = None


def ask(text: str) -> Script[Answer]:
    """Send an AT command; return its answer, which may be an error. Raises NoAnswerError if the modem is silent."""
    answer = yield Ask(command(text))
    assert isinstance(answer, Answer)
    if answer.final is SILENT:
        raise NoAnswerError("the modem answers no AT", "cut its power: captain slot cycle")
    return answer


def lines(text: str) -> Script[tuple[str, ...]]:
    """Send an AT command; return the lines of its answer. Raises StepError if the answer is an error."""
    answer = yield from ask(text)
    if not answer.final.is_ok:
        raise refusal(text, answer.final)
    return answer.lines


def refusal(text: str, final: Final) -> StepError:
    return StepError(f"{redact(text)}: {final}")


def run(*argv: str, limit_s: float = 30.0, keep: str = "") -> Script[str]:
    """Run a program; return its output.

    Raises StepError, with the last line of the output, if the exit status is not 0. Raises BlockedError instead if the
    output shows missing permission, because no recovery action can give it.
    """
    ended = yield Run(argv, limit_s, keep)
    assert isinstance(ended, Ended)
    if ended.status:
        last = redact(ended.output.strip().rpartition("\n")[2])[:200]
        if any(words in ended.output for words in _NOT_PERMITTED):
            raise BlockedError(f"{argv[0]} is not permitted: {last}", NEEDS)
        raise StepError(f"{argv[0]} ended with status {ended.status}: {last}")
    return ended.output
