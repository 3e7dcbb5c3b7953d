"""Counts of test messages between two stations: sent, received, unchanged."""

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

from firmware.client.received import Message
from firmware.lab.laboratory import Vector


class CopyRow(NamedTuple):
    """Counts of one message in one direction."""

    vector: Vector
    sender: str
    sent: int
    received: int
    equal: int

    @property
    def lost(self) -> int:
        return max(0, self.sent - self.received)

    @property
    def altered(self) -> int:
        """Messages that were received changed, or more often than they were sent."""
        return self.received - self.equal + max(0, self.equal - self.sent)


class Count:
    """Counts of each message's copies.

    The same octets are sent repeatedly, so single copies cannot be distinguished.
    """

    def __init__(self, vectors: Sequence[Vector], senders: Sequence[str]) -> None:
        self.vectors = vectors
        self.recorded = 0
        self.lost_on_air = 0  # number reported by the simulated radios
        self.strange = 0  # received messages, changed so much that their original is unknown
        self._senders = senders
        self._sent: Counter[tuple[str, int]] = Counter()
        self._received: Counter[tuple[str, int]] = Counter()
        self._equal: Counter[tuple[str, int]] = Counter()
        self._place = {vector.pdu: place for place, vector in enumerate(self.vectors)}

    def sent(self, sender: str, place: int) -> None:
        self._sent[sender, place] += 1

    def received(self, sender: str, message: Message) -> None:
        """Count a message that only this sender can have sent.

        It is equal if envelope, octets and its `raw.` message are right.
        """
        place = self._place.get(message.pdu)
        if place is None:
            place = self._closest(message)
        if place is None:
            self.strange += 1
            return
        self._received[sender, place] += 1
        vector = self.vectors[place]
        is_equal = message.pdu == vector.pdu and message.type == vector.type and message.raw is not None
        self._equal[sender, place] += is_equal

    def received_from(self, sender: str) -> int:
        """Return the number of messages received from a sender, changed or not."""
        return sum(count for (who, _), count in self._received.items() if who == sender)

    def rows(self) -> list[CopyRow]:
        return [
            CopyRow(vector, sender, self._sent[key], self._received[key], self._equal[key])
            for sender in self._senders
            for place, vector in enumerate(self.vectors)
            if (key := (sender, place)) in self._sent or key in self._received
        ]

    @property
    def missing(self) -> int:
        return self._sent.total() - self._received.total() - self.strange

    def _closest(self, message: Message) -> int | None:
        """Return the place of a message with this type and length, of which this is probably a changed copy."""
        for place, vector in enumerate(self.vectors):
            if (vector.type, len(vector.pdu)) == (message.type, len(message.pdu)):
                return place
        return None
