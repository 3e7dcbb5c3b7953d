"""Duplicate suppression: delivers a PDU received by several interfaces once."""

import math
from bisect import bisect_left
from collections import deque
from dataclasses import dataclass

from drivers.message import Indication
from drivers.reason import Reason
from firmware.routing.drops import Drops
from firmware.routing.paths import Lone, Paths
from firmware.topics import Topics

# Number of PDUs that are remembered: 2 s of a full channel (1,700 frames/s) on four interfaces, rounded up.
CAPACITY = 16384
PARTS = 64  # when CAPACITY is reached, the oldest CAPACITY / PARTS PDUs are forgotten together
LATE = 16  # PDUs are forgotten up to window_s / LATE after the end of their window, so that many are forgotten together
NOBODY: frozenset[str] = frozenset()


@dataclass
class First:
    """Counter of the PDUs that one interface received before another, and the sum of its leads."""

    count: int = 0
    lead_s: float = 0.0  # sum in seconds over the PDUs that this interface received first


class Delivery:
    """Delivered copy of a PDU.

    first   interface that received it.
    when    time of reception on the loop's clock.
    others  interfaces that have received the same copy since; theirs were suppressed.
    """

    __slots__ = ("first", "others", "when")

    def __init__(self, first: str, when: float) -> None:
        self.first = first
        self.when = when
        self.others: frozenset[str] = NOBODY

    def was_shown_by(self, interface: str) -> bool:
        return interface == self.first or interface in self.others


class Duplicates:
    """Routing stage that suppresses a PDU if another interface has delivered it within window_s seconds.

    The k-th copy of a PDU from one interface is paired with the k-th copy from another. Only the first copy of a pair
    is delivered. A repetition on the same interface is the next copy, so it is never suppressed as a duplicate of the
    previous one.

    PDUs are compared by hash(), Python's siphash of 64 bits. Its key is drawn at each start, so no sender can construct
    a collision. A collision by chance is expected once in 5,000 years. Whole PDUs would take 5 MB of memory.

    Nearly every PDU arrives only once. Until its second copy arrives, a single tuple is kept for it.
    """

    def __init__(self, window_s: float, drops: Drops, topics: Topics, capacity: int = CAPACITY) -> None:
        self.window_s = window_s
        self.suppressed = 0
        self.paths = Paths(topics)
        self.first: dict[str, First] = {}
        self._drops = drops
        self._capacity = capacity
        self._deliveries: dict[int, Lone | list[Delivery]] = {}
        self._order: deque[Lone] = deque()
        self._until = math.inf  # time at which the window of the oldest PDU ends
        self._sweep_at = math.inf  # time from which PDUs after the end of their window are forgotten

    def __call__(self, indications: list[Indication]) -> list[Indication]:
        passed = []
        order, deliveries, capacity = self._order, self._deliveries, self._capacity
        for indication in indications:
            now = indication.monotonic
            if now > self._sweep_at or len(order) >= capacity:
                self._forget(now)
            pdu = indication.pdu
            key = hash(pdu)
            lone = (now, key, indication.interface, pdu[1:6])
            known = deliveries.setdefault(key, lone)
            if known is lone or self._is_next(known, lone, pdu):
                if not order:
                    self._set_until(now)
                order.append(lone)
                passed.append(indication)
        return passed

    def expire(self, now: float) -> None:
        """Count and forget the PDUs after the end of their window. Called by a timer: stages run only on reception."""
        if now > self._until:
            self._forget(now)

    def _is_next(self, known: Lone | list[Delivery], copy: Lone, pdu: bytes) -> bool:
        """Return True if a further copy of a known PDU is to be delivered.

        Otherwise an earlier copy from another interface is its counterpart: pair both and count a duplicate.
        """
        when, key, interface, who = copy
        if when > self._until:
            self._forget(when)  # a copy after the end of its window is not a counterpart
            known = self._deliveries.setdefault(key, copy)
            if known is copy:
                return True
        if isinstance(known, tuple):
            known = self._deliveries[key] = [Delivery(known[2], known[0])]
        # In the list of deliveries, those that this interface has received come first. A binary search finds the next.
        place = bisect_left(known, True, key=lambda delivery: not delivery.was_shown_by(interface))
        if place < len(known):
            self._pair(known[place], when, interface, who)
            self._drops.count(interface, Reason.DUPLICATE, pdu)
            return False
        known.append(Delivery(interface, when))
        return True

    def _pair(self, delivery: Delivery, when: float, interface: str, who: bytes) -> None:
        delivery.others |= {interface}
        self.suppressed += 1
        first = self.first.setdefault(delivery.first, First())
        first.count += 1
        first.lead_s += when - delivery.when
        self.paths.pair(who, delivery.first, when - delivery.when)

    def _forget(self, now: float) -> None:
        """Forget PDUs after the end of their window, and the oldest of the others if CAPACITY is reached."""
        order, deliveries = self._order, self._deliveries
        room = len(order) - self._capacity + self._capacity // PARTS + 1 if len(order) >= self._capacity else 0
        since = now - self.window_s
        alone = []
        while order and (room > 0 or order[0][0] < since):
            lone = order.popleft()
            room -= 1
            key = lone[1]
            known = deliveries[key]
            if known is lone:
                del deliveries[key]
                alone.append(lone)
            elif isinstance(known, list):
                if not known.pop(0).others:
                    alone.append(lone)
                if not known:
                    del deliveries[key]
        self.paths.alone(alone)
        self._set_until(order[0][0] if order else math.inf)

    def _set_until(self, oldest: float) -> None:
        self._until = oldest + self.window_s
        self._sweep_at = self._until + self.window_s / LATE

    def status(self) -> dict[str, object]:
        """Return counts of suppressed copies, and the paths.

        window_s    seconds within which a copy is suppressed: `reception.duplicate_window_s`.
        suppressed  number of suppressed copies.
        first       number of messages that each interface received before another one, by name.
        lead_ms     average lead of each interface in ms over these messages, by name.
        """
        return {
            "window_s": self.window_s,
            "suppressed": self.suppressed,
            "first": {name: first.count for name, first in self.first.items()},
            "lead_ms": {name: round(1000 * first.lead_s / first.count, 3) for name, first in self.first.items()},
            **self.paths.status(),
        }
