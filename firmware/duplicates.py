"""The same PDU over two interfaces is delivered once; who was first is remembered."""

import math
from bisect import bisect_left
from collections import deque
from dataclasses import dataclass

from drivers.message import Indication
from drivers.reason import Reason
from firmware.drops import Drops
from firmware.paths import Lone, Paths
from firmware.topics import Topics

# PDUs remembered at once: 2 s of a channel that is full (1,700 frames/s) on four interfaces, rounded up.
CAPACITY = 16384
PARTS = 64  # in a flood one part of them is forgotten at a time
LATE = 16  # a part of the window: what has left it is forgotten so much later, many PDUs at a time
NOBODY: frozenset[str] = frozenset()


@dataclass
class First:
    """How often one interface was the first, and by how much."""

    count: int = 0
    lead_s: float = 0.0  # sum over the pairs in which it was


class Delivery:
    """One copy of a PDU that was passed on, and the interfaces that have shown it since."""

    __slots__ = ("first", "others", "when")

    def __init__(self, first: str, when: float) -> None:
        self.first = first
        self.when = when
        self.others: frozenset[str] = NOBODY

    def was_shown_by(self, interface: str) -> bool:
        return interface == self.first or interface in self.others


class Duplicates:
    """A stage: pairs the k-th copy of a PDU from one interface with the k-th from another, inside a window.

    Repeats on one interface are never suppressed: each is the next copy. A copy that has no older counterpart
    within window_s seconds is passed on.

    PDUs are told apart by hash(): Python's siphash of 64 bits under a key that is drawn at each start, which no sender
    can aim at; among the PDUs of one window a false pair is to be expected once in 5,000 years. The PDUs
    themselves would take 5 MB.

    Nearly every PDU is seen once. Until its second copy comes one tuple is all that is kept of it.
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
        self._until = math.inf  # when the oldest leaves the window
        self._sweep_at = math.inf  # when it is looked at

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
        """Count what has left the window by now: a stage is not called while nothing comes."""
        if now > self._until:
            self._forget(now)

    def _is_next(self, known: Lone | list[Delivery], copy: Lone, pdu: bytes) -> bool:
        """Whether a further copy of a known PDU is one that no other interface has shown yet; if not, it is paired."""
        when, key, interface, who = copy
        if when > self._until:
            self._forget(when)  # what has left the window is no counterpart
            known = self._deliveries.setdefault(key, copy)
            if known is copy:
                return True
        if isinstance(known, tuple):
            known = self._deliveries[key] = [Delivery(known[2], known[0])]
        # An interface has shown all deliveries up to one of them and none after it: the search may halve.
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
        """Forget what has left the window, and a part of the rest where there is no more room."""
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
        """How many were suppressed, how often each interface was first and by how much on average; and the paths."""
        return {
            "window_s": self.window_s,
            "suppressed": self.suppressed,
            "first": {name: first.count for name, first in self.first.items()},
            "lead_ms": {name: round(1000 * first.lead_s / first.count, 3) for name, first in self.first.items()},
            **self.paths.status(),
        }
