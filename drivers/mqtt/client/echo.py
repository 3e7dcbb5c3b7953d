"""Echoes: recognizes own messages that the broker returns, by their octets.

It is used if neither the broker (noLocal of MQTT 5.0) nor the profile identifies own messages.
"""

KEPT_S = 5.0  # seconds after publishing in which a message is recognized
MOST = 10_000  # most messages remembered: 2000 per second for KEPT_S


class Echoes:
    """Hashes of recently published messages (topic and payload), the oldest first."""

    def __init__(self) -> None:
        self._until: dict[int, float] = {}

    def add(self, topic: str, payload: bytes, now: float) -> None:
        self._forget(now)
        digest = hash((topic, payload))  # Python's SipHash, with a random key of this process
        self._until.pop(digest, None)  # a repeated message moves to the end, which keeps the order by time
        self._until[digest] = now + KEPT_S

    def holds(self, topic: str, payload: bytes, now: float) -> bool:
        return self._until.get(hash((topic, payload)), now) > now

    def _forget(self, now: float) -> None:
        while self._until:
            oldest = next(iter(self._until))
            if self._until[oldest] > now and len(self._until) < MOST:
                return
            del self._until[oldest]
