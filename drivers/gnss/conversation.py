"""Conversation with a receiver: sends one question at a time, repeats it, and passes on the answer."""

from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from board.runtime.loop import Loop, Timer
from drivers.wire.ublox.messages import Message

Wanted = Callable[[Message], bool]
Done = Callable[[Message | None], None]


class _Question(NamedTuple):
    octets: bytes
    wanted: Wanted
    done: Done
    tries: int
    wait_s: float


class Conversation:
    """Sends questions by `write`; hear() must get every message of the receiver.

    A repeated question may get two answers, and an acknowledgement does not name its question. After a repeated
    question the next one therefore waits, so that the second answer is not taken for its own.
    """

    def __init__(self, loop: Loop, write: Callable[[bytes], object]) -> None:
        self._loop = loop
        self._write = write
        self._waiting: deque[_Question] = deque()
        self._current: _Question | None = None
        self._timer: Timer | None = None
        self._is_settling = self._is_repeated = False

    def ask(self, octets: bytes, wanted: Wanted, done: Done, tries: int = 3, wait_s: float = 1.0) -> None:
        """Queue a question; done() gets the first message that answers it, or None if all tries got no answer.

        octets  the question, a frame.
        wanted  function that returns True if a message answers the question.
        tries   most times that the question is sent.
        wait_s  time to wait for an answer to each try.
        """
        self._waiting.append(_Question(octets, wanted, done, tries, wait_s))
        if self._current is None and not self._is_settling:
            self._next()

    def hear(self, message: Message) -> None:
        """Handle a message of the receiver; ignore it if it does not answer the current question."""
        current = self._current
        if current is not None and current.wanted(message):
            self._end(current, message)

    def close(self) -> None:
        """Discard all questions without calling done(); idempotent."""
        self._is_settling = False
        self._waiting.clear()
        self._current = None
        self._stop_waiting()

    def _next(self) -> None:
        self._is_settling = self._is_repeated = False
        if self._waiting:
            self._send(self._waiting.popleft())

    def _send(self, question: _Question) -> None:
        self._current = question._replace(tries=question.tries - 1)
        self._timer = self._loop.after(question.wait_s, self._late)
        self._write(question.octets)

    def _late(self) -> None:
        current = self._current
        if current is not None and current.tries > 0:
            self._is_repeated = True
            self._send(current)
        elif current is not None:
            self._end(current, None)

    def _end(self, question: _Question, answer: Message | None) -> None:
        self._stop_waiting()
        self._current = None
        if self._is_repeated and answer is not None:
            self._is_settling = True
            self._timer = self._loop.after(question.wait_s, self._next)
        question.done(answer)
        # Otherwise done() has already sent the next question, or a second answer to this one may still arrive.
        if self._current is None and not self._is_settling:
            self._next()

    def _stop_waiting(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
