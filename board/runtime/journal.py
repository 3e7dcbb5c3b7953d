"""Log of decisions: logs a repeated one once and counts the rest."""

import logging
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple


class Rate(NamedTuple):
    """Limit of log lines: `burst` at once, then one per `every_s` seconds."""

    burst: int
    every_s: float


# A start, a failure and a recovery with all their steps take a dozen lines.
DECISIONS = Rate(12, 10.0)
# An event that a device repeats is logged when it begins, then seldom.
REPEATS = Rate(1, 60.0)


@dataclass
class _Account:
    """Rate of one subject.

    paid_until  time up to which the written lines use up the rate.
    left_out    number of lines left out since the last written one.
    """

    paid_until: float = float("-inf")
    left_out: int = 0


class Journal:
    """Logger with a rate limit; the next written line tells how many were left out.

    name   begins each line.
    clock  monotonic seconds.
    """

    def __init__(self, log: logging.Logger, name: str, clock: Callable[[], float], rate: Rate = DECISIONS) -> None:
        self._log = log
        self._name = name
        self._clock = clock
        self._rate = rate
        self._accounts: dict[str, _Account] = {}

    def say(self, level: int, text: str, about: str = "") -> None:
        """Log a line, or count it if the rate is exceeded. Each `about` has a rate of its own; the caller names it."""
        now, (burst, every_s) = self._clock(), self._rate
        account = self._accounts.setdefault(about, _Account())
        if account.paid_until - now > (burst - 1) * every_s:
            account.left_out += 1
            return
        left_out, account.left_out = account.left_out, 0
        account.paid_until = max(now, account.paid_until) + every_s
        more = f" ({left_out} {'line' if left_out == 1 else 'lines'} omitted before this one)" if left_out else ""
        self._log.log(level, "%s: %s%s", self._name, text, more)
