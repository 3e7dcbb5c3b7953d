"""Messages with their metadata for users of port 5558: topic `message.<type>.`."""

import json
from collections import Counter

from board.runtime.loop import Loop
from drivers.message import Indication
from drivers.reason import Reason
from firmware.endpoint.feed import received_of, types_of
from firmware.endpoint.publisher import Publisher
from firmware.facilities.exchange import reception_of
from firmware.routing.drops import Drops

# Number of messages of a type per PERIOD_S. Routing has priority: further ones are numbered and counted as drops. 8,000
# are four full channels and cost a seventh of a core of a PC, 16 us each. `make swarm` has delivered 6,800 to
# `captain listen`.
BUDGET = 8_000
PLACE = "report"
PERIOD_S = 1.0


class Deliveries:
    """Publishes the messages that were delivered on port 5556, while a user subscribes to their type."""

    def __init__(self, loop: Loop, reports: Publisher, drops: Drops) -> None:
        self._clock = loop.clock
        self._drops = drops
        self._reports = reports
        self._wanted: set[bytes] = set()
        self._types: frozenset[str] = frozenset()  # types that a user wants
        self._told = Counter[str]()  # messages of each type that were published in this period
        self._renewed = loop.clock()

    def want(self, topic: bytes, is_wanted: bool) -> None:
        """Start or stop a topic: its first subscriber came, or its last one left."""
        (self._wanted.add if is_wanted else self._wanted.discard)(topic)
        self._types = types_of(self._wanted)

    def publish(self, indications: list[Indication], sequences: list[int]) -> None:
        """Publish those messages whose type a user wants."""
        if self._clock() >= self._renewed + PERIOD_S:
            self._told.clear()
            self._renewed = self._clock()
        for one, sequence in zip(indications, sequences, strict=True):
            if one.kind.name not in self._types:
                continue
            self._told[one.kind.name] += 1
            if self._told[one.kind.name] > BUDGET:
                self._drops.count(PLACE, Reason.DELIVERY_LIMIT, one.pdu)
            else:
                topic = f"message.{one.kind.name}.".encode()
                self._reports.publish_both(topic, json.dumps(delivery_of(one, sequence)).encode(), one.pdu)


def delivery_of(one: Indication, sequence: int) -> dict[str, object]:
    """Return the object of a delivered message.

    type           message type; empty without a known one.
    data_rate      data rate in 500 kbit/s; 0 if unknown.
    traffic_class  traffic class of the packet; 0 if unknown.
    hop_limit      remaining hop limit of the packet; 0 if unknown.
    """
    rx = one.rx
    told = {"data_rate": rx.data_rate, "traffic_class": rx.traffic_class, "hop_limit": rx.hop_limit}
    return {"type": one.kind.name, **reception_of(received_of(one, sequence)), **told}
