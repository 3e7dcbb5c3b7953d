"""The same PDU over two interfaces is delivered once; who was first is remembered."""

from bisect import bisect_left
from collections import deque
from dataclasses import dataclass

from drivers.message import Indication
from drivers.reason import Reason
from firmware.drops import Drops

# PDUs remembered at once: 2 s of a channel that is full (1,700 frames/s) on four interfaces, rounded up.
CAPACITY = 16384
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
    """

    def __init__(self, window_s: float, drops: Drops, capacity: int = CAPACITY) -> None:
        self.window_s = window_s
        self.suppressed = 0
        self.first: dict[str, First] = {}
        self._drops = drops
        self._capacity = capacity
        self._deliveries: dict[int, list[Delivery]] = {}
        self._order: deque[tuple[float, int]] = deque()

    def __call__(self, indication: Indication) -> Indication | None:
        now = indication.monotonic
        order = self._order
        while order and (order[0][0] < now - self.window_s or len(order) >= self._capacity):
            self._forget()
        interface = indication.interface
        key = hash(indication.pdu)
        deliveries = self._deliveries.get(key)
        if deliveries is None:
            self._deliveries[key] = [Delivery(interface, now)]
        else:
            # An interface has shown all deliveries up to one of them and none after it: the search may halve.
            place = bisect_left(deliveries, True, key=lambda delivery: not delivery.was_shown_by(interface))
            if place < len(deliveries):
                self._pair(deliveries[place], indication)
                return None
            deliveries.append(Delivery(interface, now))
        order.append((now, key))
        return indication

    def _pair(self, delivery: Delivery, indication: Indication) -> None:
        delivery.others |= {indication.interface}
        self.suppressed += 1
        first = self.first.setdefault(delivery.first, First())
        first.count += 1
        first.lead_s += indication.monotonic - delivery.when
        self._drops.count(indication.interface, Reason.DUPLICATE, indication.pdu)

    def _forget(self) -> None:
        _, key = self._order.popleft()
        deliveries = self._deliveries[key]
        del deliveries[0]
        if not deliveries:
            del self._deliveries[key]

    def status(self) -> dict[str, object]:
        """How many were suppressed, and for each interface how often it was first and by how much on average."""
        return {
            "window_s": self.window_s,
            "suppressed": self.suppressed,
            "first": {name: first.count for name, first in self.first.items()},
            "lead_ms": {name: round(1000 * first.lead_s / first.count, 3) for name, first in self.first.items()},
        }
