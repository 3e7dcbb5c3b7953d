"""Messages a second of each interface, of what two statuses count."""

from collections.abc import Mapping
from typing import NamedTuple

from firmware.user.untrusted import named, number, within

SHORTEST_S = 0.5  # a burst of a moment is no rate


class Rate(NamedTuple):
    received: float
    sent: float


class Rates:
    """Between the last two statuses of one station. The first of a station has none."""

    def __init__(self) -> None:
        self.of: dict[str, Rate] = {}
        self._who: tuple[float, float] = (0.0, 0.0)
        self._then = 0.0
        self._counts: dict[str, Rate] = {}

    def add(self, status: Mapping[str, object], now: float) -> None:
        """Another status; now is monotonic."""
        elapsed_s = now - self._then
        if self._counts and elapsed_s < SHORTEST_S:
            return
        uptime_s = number(status, "uptime_s")
        is_same = number(status, "pid") == self._who[0] and uptime_s >= self._who[1]
        counts = {name: Rate(_sum(one, "received"), _sum(one, "sent")) for name, one in named(status, "interfaces")}
        before = self._counts if is_same else {}
        self.of = {name: _rate(before[name], count, elapsed_s) for name, count in counts.items() if name in before}
        self._counts, self._then, self._who = counts, now, (number(status, "pid"), uptime_s)


def _rate(before: Rate, now: Rate, elapsed_s: float) -> Rate:
    """An interface that was made again counts from 0 again."""
    received, sent = (max(0.0, new - old) / elapsed_s for old, new in zip(before, now, strict=True))
    return Rate(received, sent)


def _sum(one: Mapping[str, object], key: str) -> float:
    counts = within(one, key)
    return sum(number(counts, kind) for kind in counts)
