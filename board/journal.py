"""A log that says what is decided, and counts what would be said too often: a bad contact decides every second."""

import logging
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple


class Rate(NamedTuple):
    """So many lines at once, and one more every so many seconds."""

    burst: int
    every_s: float


# A start, a failure and a recovery with all their steps are a dozen lines.
DECISIONS = Rate(12, 10.0)
# What a device does again and again is told when it begins, and then seldom.
REPEATS = Rate(1, 60.0)


@dataclass
class _Account:
    """Of one subject. paid_until: when the lines that were written would have been due one after the other."""

    paid_until: float = float("-inf")
    left_out: int = 0


class Journal:
    """Lines about one thing to one logger, as many as its rate allows; the next one says how many were left out.

    name   of the thing: each line begins with it.
    clock  monotonic seconds.
    """

    def __init__(self, log: logging.Logger, name: str, clock: Callable[[], float], rate: Rate = DECISIONS) -> None:
        self._log = log
        self._name = name
        self._clock = clock
        self._rate = rate
        self._accounts: dict[str, _Account] = {}

    def say(self, level: int, text: str, about: str = "") -> None:
        """Log a line, or count it. Each subject has the whole rate for itself; subjects are words of the caller's."""
        now, (burst, every_s) = self._clock(), self._rate
        account = self._accounts.setdefault(about, _Account())
        if account.paid_until - now > (burst - 1) * every_s:
            account.left_out += 1
            return
        left_out, account.left_out = account.left_out, 0
        account.paid_until = max(now, account.paid_until) + every_s
        more = f" ({left_out} {'line' if left_out == 1 else 'lines'} before it left out)" if left_out else ""
        self._log.log(level, "%s: %s%s", self._name, text, more)
