"""Queue of blocking bus calls: sends them to the board process, and never waits."""

import itertools
import json
import logging
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from board.bus_calls import first_message
from board.description import Hardware
from board.machine import Machine
from board.runtime.child import GRACE_S
from board.runtime.errors import InterfaceError
from board.runtime.loop import Loop, Timer
from board.runtime.worker import Worker

# The kernel gives up a stuck bus after 1 s. The deadline is longer, so that the kernel's error arrives first.
DEADLINE_S = 3.0
QUEUE = 64  # most calls that wait for the current one
PATIENCE_S = 30.0  # longest wait of a queued call, for the start of the worker or the end of earlier calls

Done = Callable[[Any], None]  # receives the call's value, as listed in README.md, or an InterfaceError

log = logging.getLogger("captain.board")


class BoardWorker:
    """Queue of calls to the board process; executes one at a time.

    on_state  called when the worker starts or ends: true while it runs, and the reason.
    command   command line of the worker; see Worker.
    late      number of calls that exceeded their deadline; the worker was restarted after each.
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
        self._timers: dict[int, Timer] = {}  # by call: limit of its wait, then its deadline
        self._why = "is not started"
        self._is_told = False  # True: the failure of the worker was logged already

    @property
    def is_up(self) -> bool:
        return self._worker.is_up

    def start(self) -> None:
        """Start the worker and return at once."""
        self._worker.start()

    def ask(self, do: str, arguments: Mapping[str, object], done: Done, deadline_s: float = DEADLINE_S) -> None:
        """Queue a call; done() receives its value or an InterfaceError.

        done() is called once, never before ask() returns, and not after stop().

        deadline_s  longest duration of the call, from the end of the previous one. A call that exceeds it fails,
                    and the worker is restarted. The new worker executes the queued calls.
        """
        self.calls += 1
        call = _Call(next(self._numbers), do, arguments, done, deadline_s)
        if len(self._waiting) < QUEUE:
            self._timers[call.number] = self._loop.after(PATIENCE_S, lambda: self._give_up(call))
            self._waiting.append(call)
            self._next()
        else:
            error = InterfaceError(f"{call.what}: queue of the board process full: {QUEUE} calls", "ask less often")
            self._timers[call.number] = self._loop.after(0.0, lambda: self._end(call, error))

    def stop(self) -> None:
        """Stop the worker and discard all calls without an answer; idempotent."""
        self._forget()
        self._worker.stop()

    def finish(self, within: float = GRACE_S) -> None:
        """Stop at the end of the program: return when the worker has ended; kill it after `within` seconds."""
        self._forget()
        self._worker.finish(within)

    def status(self) -> dict[str, object]:
        """Return the status of the board process.

        is_up     the process runs.
        why       state in words.
        restarts  number of restarts.
        calls     number of calls.
        failed    number of failed calls.
        late      number of calls that exceeded their deadline.
        waiting   number of queued calls.
        doing     current call; null without one.
        """
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
        self._timers[call.number].cancel()
        self._timers[call.number] = self._loop.after(call.deadline_s, lambda: self._is_late(call))

    def _answered(self, message: bytes) -> None:
        answer, call = json.loads(message), self._current
        if call is None or answer["id"] != call.number:
            raise AssertionError(f"the board process sent an unexpected answer: {message[:80]!r}")
        self._is_told = False
        if "error" in answer:
            self._end(call, InterfaceError(answer["error"], answer["hint"]))
        else:
            self._end(call, answer["value"])

    def _is_late(self, call: "_Call") -> None:
        self.late += 1
        self._why = f"restarts: {call.what} took longer than {call.deadline_s:g} s"
        # stop() does not call _changed(), and does not wait for the old worker, which the kernel may block.
        self._worker.stop()
        self._on_state(False, self._why)
        self._worker.start()
        what = f"{call.what}: timeout after {call.deadline_s:g} s; the board process restarts"
        self._end(call, InterfaceError(what, "a bus or device blocks it: compare with the other parts on the same bus"))

    def _give_up(self, call: "_Call") -> None:
        self._waiting.remove(call)
        error = InterfaceError(f"{call.what}: not started within {PATIENCE_S:g} s: the board process {self._why}")
        self._end(call, error)

    def _end(self, call: "_Call", outcome: object) -> None:
        """Pass the outcome of a call to its done(), then start the next call."""
        timer = self._timers.pop(call.number, None)
        if timer is None:
            return  # on_state() called stop()
        timer.cancel()
        if self._current is call:
            self._current = None
        self.failed += isinstance(outcome, InterfaceError)
        call.done(outcome)
        self._next()

    def _changed(self, is_up: bool, why: str) -> None:
        self._why = why
        if is_up:
            self._worker.send(self._first)
            self._on_state(is_up, why)
            self._next()
            return
        self._on_state(is_up, why)
        if not self._is_told:
            self._is_told = True
            log.warning("the board process: %s", why)
        call = self._current
        if call is not None:
            self._end(call, InterfaceError(f"{call.what}: the board process: {why}", "see the journal for its output"))

    def _forget(self) -> None:
        for timer in self._timers.values():
            timer.cancel()
        self._timers.clear()
        self._waiting.clear()
        self._current = None


class _Call:
    """One call: its message, and the function that receives its outcome."""

    def __init__(self, number: int, do: str, arguments: Mapping[str, object], done: Done, deadline_s: float) -> None:
        self.number = number
        self.what = " ".join([do, *map(str, arguments.values())])
        self.message = json.dumps({"id": number, "do": do, **arguments}).encode()
        self.done = done
        self.deadline_s = deadline_s
