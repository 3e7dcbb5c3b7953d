"""Drop counters: one per place and reason, each with a sample."""

import logging
import time
from collections.abc import Iterator
from typing import Protocol

from drivers.reason import MEANING, Reason

SAMPLE = 64  # number of octets of the last dropped message that the status shows
DETAIL = 200  # number of characters of `detail` that are kept
# Reasons for which a station in order drops messages all the time. They are logged at INFO, the others at WARNING.
USUAL = frozenset({Reason.DUPLICATE, Reason.OWN_ECHO, Reason.GN_DUPLICATE, Reason.GN_NOT_FOR_US})

log = logging.getLogger("captain.drops")


class Drop:
    """Counter of one reason at one place, with the last dropped message."""

    __slots__ = ("count", "detail", "octets", "sample", "time")

    def __init__(self) -> None:
        self.count = 0
        self.sample = b""
        self.octets = 0
        self.detail = ""
        self.time = 0.0

    def add(self, sample: bytes, count: int, detail: str) -> bool:
        """Count dropped messages. Return True if this count is to be logged: the 1st, 10th, 100th and so on.

        sample  octets of the last one; empty if they are unknown.
        detail  cause in this case; empty if unknown.
        """
        before = self.count
        self.count = before + count
        self.time = time.time()
        if sample:
            self.sample = sample[:SAMPLE]
            self.octets = len(sample)
        if sample or detail:
            # An empty detail replaces an earlier one too, which would not belong to the new sample.
            self.detail = detail[:DETAIL]
        return before == 0 or len(str(before)) != len(str(self.count))

    def status(self) -> dict[str, object]:
        """Return the count and the last dropped message.

        count   number of messages.
        time    Unix time of the last message.
        octets  length of the last message.
        sample  first 64 octets of the last message, hexadecimal.
        """
        return {"count": self.count, "time": self.time, "octets": self.octets, "sample": self.sample.hex()}


class DropListener(Protocol):
    """Receiver of each dropped message with all its octets."""

    def drop(self, where: str, reason: Reason, sample: bytes, count: int, detail: str) -> None: ...


class Drops:
    """All drop counters, by place and reason. Their number is bounded: places are interfaces and sockets.

    listener  receives each dropped message; None if no program wants them.
    """

    def __init__(self) -> None:
        self.listener: DropListener | None = None
        self._drops: dict[tuple[str, Reason], Drop] = {}

    def count(self, where: str, reason: Reason, sample: bytes = b"", count: int = 1, detail: str = "") -> None:
        """Count dropped messages, pass them to the listener, and log them at powers of ten.

        where   place: name of an interface, or from_users, pull, to_users, report, from_brokers.
        sample  octets of the dropped message; empty if they are unknown.
        count   number of dropped messages.
        detail  cause in this case, if more than the reason is known.
        """
        drop = self._drops.get((where, reason))
        if drop is None:
            drop = self._drops[where, reason] = Drop()
        is_told = drop.add(sample, count, detail)
        if self.listener is not None:
            self.listener.drop(where, reason, sample, count, detail)
        if is_told:
            level = logging.INFO if reason in USUAL else logging.WARNING
            why = f"{MEANING[reason]}: {drop.detail}" if drop.detail else MEANING[reason]
            log.log(level, "%s: %s: %d dropped: %s", where, reason, drop.count, why)

    def total(self, where: str, reason: Reason) -> int:
        drop = self._drops.get((where, reason))
        return drop.count if drop else 0

    def sum(self, where: str, without: frozenset[Reason]) -> int:
        """Return the number of messages dropped at a place for any reason except those in `without`."""
        rows = self._drops.items()
        return sum(drop.count for (place, reason), drop in rows if place == where and reason not in without)

    def status(self) -> Iterator[dict[str, object]]:
        """Yield an object for each place and reason.

        where    name of the interface; `from_users`, `pull`, `to_users` or `report` for a socket; `from_brokers` for
                 requests of applications at brokers.
        reason   drop reason.
        meaning  meaning of the reason.
        detail   cause of the last drop, if known.
        """
        for (where, reason), drop in self._drops.items():
            yield {
                "where": where,
                "reason": str(reason),
                "meaning": MEANING[reason],
                **drop.status(),
                "detail": drop.detail,
            }
