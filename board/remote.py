"""The loop's side of what blocks: it asks the worker of board/hands.py, and never waits for it."""

import itertools
import json
import logging
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from board.child import GRACE_S
from board.description import Hardware
from board.errors import InterfaceError
from board.hands import first_message
from board.loop import Loop, Timer
from board.machine import Machine
from board.worker import Worker

# Longer than the kernel's own patience with a stuck bus, 1 s, so that its word of it arrives.
DEADLINE_S = 3.0
QUEUE = 64  # calls that wait for the one under way
PATIENCE_S = 30.0  # of a call that waits, for the worker to come up or the others to end

Done = Callable[[Any], None]  # given the value as README.md has it, or an InterfaceError

log = logging.getLogger("captain.board")


class Remote:
    """Calls to the board's worker, one under way at a time.

    on_state  called with whether the worker runs, and why.
    command   as Worker has it.
    late      calls that were not answered in time, each of which has cost a worker.
    """

    def __init__(
        self,
        loop: Loop,
        hardware: Hardware,
        machine: Machine,
        worker_name: str,
        on_state: Callable[[bool, str], None] = lambda is_up, why: None,
        *,
        command: Sequence[str] = (),
    ) -> None:
        self.late = self.calls = self.failed = 0
        self._loop = loop
        self._on_state = on_state
        self._first = first_message(hardware, machine)
        self._worker = Worker(loop, worker_name, self._answered, self._changed, command=command)
        self._numbers = itertools.count(1)
        self._waiting: deque[_Call] = deque()
        self._current: _Call | None = None
        self._why = "is not started"
        self._is_told = False  # that it does not run

    @property
    def is_up(self) -> bool:
        return self._worker.is_up

    def start(self) -> None:
        """Start the worker and return at once."""
        self._worker.start()

    def ask(self, do: str, arguments: Mapping[str, object], done: Done, deadline_s: float = DEADLINE_S) -> None:
        """Have a call done; done() is given its value or an InterfaceError, once, later, and never after stop().

        deadline_s  from when the call before it has ended; it then costs the worker, which is started anew. Calls
                    that wait are done by the new one.
        """
        call = _Call(next(self._numbers), do, arguments, done, deadline_s)
        self.calls += 1
        if len(self._waiting) >= QUEUE:
            error = InterfaceError(f"{call.what}: {QUEUE} calls wait for the board's worker already", "ask less often")
            call.timer = self._loop.after(0.0, lambda: self._end(call, error))
            return
        call.timer = self._loop.after(PATIENCE_S, lambda: self._give_up(call))
        self._waiting.append(call)
        self._next()

    def stop(self) -> None:
        """Let the worker go and answer nobody any more; idempotent."""
        self._forget()
        self._worker.stop()

    def finish(self, within: float = GRACE_S) -> None:
        """stop() for the end of the program: returns when the worker is gone, killed if need be."""
        self._forget()
        self._worker.finish(within)

    def status(self) -> dict[str, object]:
        """For the station's status, as JSON."""
        return {
            "is_up": self.is_up,
            "why": self._why,
            "restarts": self._worker.restarts + self.late,
            "calls": self.calls,
            "failed": self.failed,
            "late": self.late,
            "waiting": len(self._waiting),
            "doing": self._current.what if self._current else None,
        }

    def _next(self) -> None:
        if self._current is not None or not self._waiting or not self._worker.send(self._waiting[0].message):
            return
        call = self._current = self._waiting.popleft()
        call.start(self._loop.after(call.deadline_s, lambda: self._is_late(call)))

    def _answered(self, message: bytes) -> None:
        answer, call = json.loads(message), self._current
        if call is None or answer["id"] != call.number:
            raise AssertionError(f"the board's worker answered what nobody asked: {message[:80]!r}")
        self._is_told = False
        if "error" in answer:
            self._end(call, InterfaceError(answer["error"], answer["hint"]))
        else:
            self._end(call, answer["value"])

    def _is_late(self, call: "_Call") -> None:
        self.late += 1
        self._why = f"is started anew: {call.what} took longer than {call.deadline_s:g} s"
        # stop() tells nobody and does not wait for the old one, which may be held inside the kernel.
        self._worker.stop()
        self._on_state(False, self._why)
        self._worker.start()
        what = f"{call.what}: no answer within {call.deadline_s:g} s; the board's worker is started anew"
        self._end(call, InterfaceError(what, "a bus or a device holds it: see what is said of the others at the same"))

    def _give_up(self, call: "_Call") -> None:
        self._waiting.remove(call)
        error = InterfaceError(f"{call.what}: not begun within {PATIENCE_S:g} s: the board's worker {self._why}")
        self._end(call, error)

    def _end(self, call: "_Call", outcome: object) -> None:
        """Answer a call, and go on with the next."""
        call.timer.cancel()
        if self._current is call:
            self._current = None
        self.failed += isinstance(outcome, InterfaceError)
        call.done(outcome)
        self._next()

    def _changed(self, is_up: bool, why: str) -> None:
        self._why = why
        self._on_state(is_up, why)
        if is_up:
            self._worker.send(self._first)
            self._next()
            return
        if not self._is_told:
            self._is_told = True
            log.warning("the board's worker: %s", why)
        call = self._current
        if call is not None:
            self._end(
                call, InterfaceError(f"{call.what}: the board's worker: {why}", "the journal has what it printed")
            )

    def _forget(self) -> None:
        for call in (*self._waiting, *filter(None, [self._current])):
            call.timer.cancel()
        self._waiting.clear()
        self._current = None


class _Call:
    """One call: its message, and whom to answer.

    timer  its patience, then its deadline.
    """

    timer: Timer

    def __init__(self, number: int, do: str, arguments: Mapping[str, object], done: Done, deadline_s: float) -> None:
        self.number = number
        self.what = " ".join([do, *map(str, arguments.values())])
        self.message = json.dumps({"id": number, "do": do, **arguments}).encode()
        self.done = done
        self.deadline_s = deadline_s

    def start(self, deadline: Timer) -> None:
        self.timer.cancel()
        self.timer = deadline
