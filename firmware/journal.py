"""A log that says what is decided, and counts what would be said too often: a bad contact decides every second."""

import logging
from collections.abc import Callable

BURST = 12  # lines at once: a start, a failure and a recovery with all their steps
EVERY_S = 10.0  # for each further one


class Journal:
    """Lines to one logger, as many as BURST and EVERY_S allow; each that follows says how many were left out."""

    def __init__(self, log: logging.Logger, clock: Callable[[], float]) -> None:
        self.left_out = 0
        self._log = log
        self._clock = clock
        self._room = float(BURST)
        self._then = clock()

    def say(self, level: int, text: str, *arguments: object) -> None:
        now = self._clock()
        self._room = min(float(BURST), self._room + (now - self._then) / EVERY_S)
        self._then = now
        if self._room < 1.0:
            self.left_out += 1
            return
        self._room -= 1.0
        if self.left_out:
            text, arguments = text + " (%d lines before it were left out)", (*arguments, self.left_out)
            self.left_out = 0
        self._log.log(level, text, *arguments)
