"""Every message that was not passed on: where, why, how many, and the last one."""

import logging
import time
from collections.abc import Callable, Iterator

from drivers.reason import MEANING, Reason

SAMPLE = 64  # octets shown of the last one
DETAIL = 200  # characters kept of what was said about it
# What a healthy station discards all day: worth counting, not worth a warning.
USUAL = frozenset({Reason.DUPLICATE, Reason.OWN_ECHO, Reason.GN_DUPLICATE, Reason.GN_NOT_FOR_US})

log = logging.getLogger("captain.drops")


class Drop:
    """The count of one reason at one place."""

    __slots__ = ("count", "detail", "octets", "sample", "time")

    def __init__(self) -> None:
        self.count = 0
        self.sample = b""
        self.octets = 0
        self.detail = ""
        self.time = 0.0

    def add(self, sample: bytes, count: int, detail: str) -> bool:
        """Count discards; return whether the journal reports it: the first, the tenth, the hundredth and so on."""
        before = self.count
        self.count = before + count
        self.time = time.time()
        if sample:
            self.sample = sample[:SAMPLE]
            self.octets = len(sample)
        if sample or detail:
            self.detail = detail[:DETAIL]  # of the sample: that of an earlier one would explain another
        return before == 0 or len(str(before)) != len(str(self.count))

    def status(self) -> dict[str, object]:
        """Members that the status has of each count."""
        return {"count": self.count, "time": self.time, "octets": self.octets, "sample": self.sample.hex()}


class Drops:
    """Counters by place and reason. Bounded: places are interfaces and sockets, reasons are an enumeration.

    watch  is shown each discard with all its octets: where, reason, sample, count, detail; None while nobody looks.
    """

    def __init__(self) -> None:
        self.watch: Callable[[str, Reason, bytes, int, str], None] | None = None
        self._drops: dict[tuple[str, Reason], Drop] = {}

    def count(self, where: str, reason: Reason, sample: bytes = b"", count: int = 1, detail: str = "") -> None:
        """Count a discard and keep its octets as the last sample.

        where   an interface's name, or from_users, pull, to_users, report.
        sample  what was discarded, empty where nobody has it.
        detail  why just this one, where more is known than the reason.
        """
        drop = self._drops.get((where, reason))
        if drop is None:
            drop = self._drops[where, reason] = Drop()
        is_told = drop.add(sample, count, detail)
        if self.watch is not None:
            self.watch(where, reason, sample, count, detail)
        if is_told:
            level = logging.INFO if reason in USUAL else logging.WARNING
            why = f"{MEANING[reason]}: {drop.detail}" if drop.detail else MEANING[reason]
            log.log(level, "%s: %s: %d dropped: %s", where, reason, drop.count, why)

    def total(self, where: str, reason: Reason) -> int:
        drop = self._drops.get((where, reason))
        return drop.count if drop else 0

    def sum(self, where: str, without: frozenset[Reason]) -> int:
        """All that was dropped at a place, but for some reasons."""
        rows = self._drops.items()
        return sum(drop.count for (place, reason), drop in rows if place == where and reason not in without)

    def status(self) -> Iterator[dict[str, object]]:
        """One JSON object for each place and reason, as in the status message."""
        for (where, reason), drop in self._drops.items():
            yield {
                "where": where,
                "reason": str(reason),
                "meaning": MEANING[reason],
                **drop.status(),
                "detail": drop.detail,
            }
