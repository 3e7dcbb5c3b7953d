"""Messages per second of each interface, from two statuses."""

from collections.abc import Mapping
from typing import NamedTuple

from firmware.untrusted import named, number, total

SHORTEST_S = 0.5  # shortest time between two statuses for a rate


class Rate(NamedTuple):
    received: float
    sent: float


class Rates:
    """Rates between the last two statuses of a station; empty after the first."""

    def __init__(self) -> None:
        self.of: dict[str, Rate] = {}
        self._who: tuple[float, float] = (0.0, 0.0)
        self._then = 0.0
        self._counts: dict[str, Rate] = {}

    def add(self, status: Mapping[str, object], now: float) -> None:
        """Add a status; now is monotonic, s."""
        elapsed_s = now - self._then
        if self._counts and elapsed_s < SHORTEST_S:
            return
        uptime_s = number(status, "uptime_s")
        is_same = number(status, "pid") == self._who[0] and uptime_s >= self._who[1]
        counts = {name: Rate(total(one, "received"), total(one, "sent")) for name, one in named(status, "interfaces")}
        before = self._counts if is_same else {}
        self.of = {name: _rate(before[name], count, elapsed_s) for name, count in counts.items() if name in before}
        self._counts, self._then, self._who = counts, now, (number(status, "pid"), uptime_s)


def _rate(before: Rate, now: Rate, elapsed_s: float) -> Rate:
    """Return the rate of an interface; a restarted one counts from 0, which must not give a negative rate."""
    received, sent = (max(0.0, new - old) / elapsed_s for old, new in zip(before, now, strict=True))
    return Rate(received, sent)
