"""What a modem needs done, one thing after the other, written as generators: a step yields what it waits for.

    def attach() -> Script[None]:
        yield Begin("attach")
        answer = yield from ask("AT+CGATT?")

The runner does what is yielded on the loop and resumes the generator with the result; nothing waits.
"""

from collections.abc import Callable, Generator
from typing import Any, NamedTuple, Protocol, TypeAlias, TypeVar

from board.errors import BlockedError, InterfaceError, StationError
from board.loop import Loop, Timer
from drivers.wire.at import Answer
from drivers.wire.at_forms import SILENT, Command, Final, command
from drivers.wire.redact import redact

T = TypeVar("T")

# EPERM and EACCES as every program words them.
_NOT_PERMITTED = ("Operation not permitted", "Permission denied")
NEEDS = "a bearer takes the right to configure network devices: CAP_NET_ADMIN"

LEAST_PAUSE_S = 1.0  # whatever wakes it: a storm of unsolicited codes makes no storm of questions


class Begin(NamedTuple):
    """A step begins, and has limit_s; None: as long as it takes."""

    step: str
    limit_s: float | None


class Ask(NamedTuple):
    """A command; resumed with its Answer."""

    command: Command


class Pause(NamedTuple):
    """Some time; wakes says whether wake() ends it before."""

    seconds: float
    wakes: bool = False


class Run(NamedTuple):
    """A program; resumed with its Ended, or with what it had said when `keep` was found in that: then it goes on."""

    argv: tuple[str, ...]
    limit_s: float
    keep: str = ""


class Ended(NamedTuple):
    """A program has ended, or is kept: status is then None."""

    status: int | None
    output: str


Effect: TypeAlias = Begin | Ask | Pause | Run
Script: TypeAlias = Generator[Effect, Any, T]


class StepError(InterfaceError):
    """A step failed; recovery begins."""


class NoAnswerError(StepError):
    """Not even AT is answered."""


class LostError(StepError):
    """What was there is gone: the network, or the bearer. It is looked for again before anything is reset."""


class Program(Protocol):
    """A program that runs."""

    def stop(self) -> None: ...


class World(Protocol):
    """What a runner needs: where commands go, how programs are run, who is told of steps.

    why  it is not done: the step, and what in it is waited for.
    """

    @property
    def why(self) -> str: ...
    def ask(self, command: Command, done: Callable[[Answer], None]) -> None: ...
    def run(self, run: Run, done: Callable[[Ended | StationError], None]) -> Program: ...
    def begun(self, step: str) -> None: ...


class Runner:
    """Runs one script; done is called with the StationError that it did not catch."""

    def __init__(self, loop: Loop, world: World, script: Script[None], done: Callable[[StationError], None]) -> None:
        self._loop = loop
        self._world = world
        self._script = script
        self._done = done
        self._turn = 0  # of the script: a result that belongs to an earlier one is none
        self._limit: Timer | None = None
        self._pause: Timer | None = None
        self._woken_from: float | None = None  # when a pause that wakes may end at the earliest
        self._program: Program | None = None

    def start(self) -> None:
        """Let it run to the first thing that it waits for."""
        self._resume(lambda: next(self._script))

    def wake(self) -> None:
        """End a pause that wakes; one that has just begun lasts LEAST_PAUSE_S."""
        if self._woken_from is not None and self._pause is not None:
            self._pause.cancel()
            self._pause = self._after(self._woken_from - self._loop.clock())
            self._woken_from = None

    def interrupt(self, error: StationError) -> None:
        """Raise an error where the script waits."""
        self._leave()
        self._resume(lambda: self._script.throw(error))

    def stop(self) -> None:
        """End it here."""
        self._leave()
        if self._limit is not None:
            self._limit.cancel()
        self._script.close()

    def _resume(self, advance: Callable[[], Effect]) -> None:
        """Let the script go on to what it waits for next."""
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
        self._program = None  # has ended, or is kept by the world
        self._leave()
        if isinstance(result, StationError):
            self._resume(lambda: self._script.throw(result))
        else:
            self._resume(lambda: self._script.send(result))

    def _late(self, begin: Begin) -> None:
        self._limit = None
        self.interrupt(StepError(f"{self._world.why}: not done within {begin.limit_s:.0f} s"))

    def _leave(self) -> None:
        """Nothing that was waited for counts any more."""
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
    """A command, whatever its answer. Raises NoAnswerError where the modem is silent."""
    answer = yield Ask(command(text))
    assert isinstance(answer, Answer)
    if answer.final is SILENT:
        raise NoAnswerError("the modem answers no AT", "cut its power: captain slot cycle")
    return answer


def lines(text: str) -> Script[tuple[str, ...]]:
    """The lines that answer a command. Raises StepError where it fails."""
    answer = yield from ask(text)
    if not answer.final.is_ok:
        raise refusal(text, answer.final)
    return answer.lines


def refusal(text: str, final: Final) -> StepError:
    return StepError(f"{redact(text)}: {final}")


def run(*argv: str, limit_s: float = 30.0, keep: str = "") -> Script[str]:
    """What a program says. Raises StepError where it fails, with the last line that it said.

    BlockedError where it was not permitted: no reset of a modem gives a right.
    """
    ended = yield Run(argv, limit_s, keep)
    assert isinstance(ended, Ended)
    if ended.status:
        last = redact(ended.output.strip().rpartition("\n")[2])[:200]
        if any(words in ended.output for words in _NOT_PERMITTED):
            raise BlockedError(f"{argv[0]} is not permitted: {last}", NEEDS)
        raise StepError(f"{argv[0]} ended with status {ended.status}: {last}")
    return ended.output
