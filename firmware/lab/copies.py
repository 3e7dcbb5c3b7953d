"""Copies of test messages between two stations: how many were sent, came, and came whole."""

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

from firmware.lab.laboratory import Vector
from firmware.user.received import Message


class Row(NamedTuple):
    """One message in one direction."""

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
        """Also what came more often than it was sent."""
        return self.received - self.equal + max(0, self.equal - self.sent)


class Count:
    """Copies of each message: the same octets travel again and again, so copies are what can be counted."""

    def __init__(self, vectors: Sequence[Vector], senders: Sequence[str]) -> None:
        self.vectors = vectors
        self.recorded = 0
        self.lost_on_air = 0  # as the simulated radios say
        self.strange = 0  # received, and so much altered that it cannot be said from what
        self._senders = senders
        self._sent: Counter[tuple[str, int]] = Counter()
        self._received: Counter[tuple[str, int]] = Counter()
        self._equal: Counter[tuple[str, int]] = Counter()
        self._place = {vector.pdu: place for place, vector in enumerate(self.vectors)}

    def sent(self, sender: str, place: int) -> None:
        self._sent[sender, place] += 1

    def received(self, sender: str, message: Message) -> None:
        """A message that can only be the sender's; whole when envelope, octets and raw. message are."""
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
        """All that a user was delivered, whatever it was sent as."""
        return sum(count for (who, _), count in self._received.items() if who == sender)

    def rows(self) -> list[Row]:
        return [
            Row(vector, sender, self._sent[key], self._received[key], self._equal[key])
            for sender in self._senders
            for place, vector in enumerate(self.vectors)
            if (key := (sender, place)) in self._sent or key in self._received
        ]

    @property
    def missing(self) -> int:
        return self._sent.total() - self._received.total() - self.strange

    def _closest(self, message: Message) -> int | None:
        """The message of this type and length, which this once was."""
        for place, vector in enumerate(self.vectors):
            if (vector.type, len(vector.pdu)) == (message.type, len(message.pdu)):
                return place
        return None
