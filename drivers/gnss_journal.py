"""What a receiver does again and again is logged when it begins, and then seldom."""

import logging
from collections.abc import Callable

SELDOM_S = 60.0  # between two lines about the same


class Journal:
    """Lines of the journal about one receiver.

    name   of the interface: each line begins with it.
    clock  monotonic seconds.
    """

    def __init__(self, log: logging.Logger, name: str, clock: Callable[[], float]) -> None:
        self._log = log
        self._name = name
        self._clock = clock
        self._said: dict[str, float] = {}
        self._unsaid: dict[str, int] = {}

    def say(self, level: int, about: str, text: str) -> None:
        """Log a line, unless one about the same was logged a minute ago or less; the next says how many were not."""
        now = self._clock()
        if now - self._said.get(about, -SELDOM_S) < SELDOM_S:
            self._unsaid[about] = self._unsaid.get(about, 0) + 1
            return
        unsaid = self._unsaid.pop(about, 0)
        self._said[about] = now
        more = f"; {unsaid} times more since then" if unsaid else ""
        self._log.log(level, "%s: %s%s", self._name, text, more)
