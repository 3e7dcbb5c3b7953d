"""Own messages that come back where neither the broker nor the profile tells: known by their octets for a while."""

KEPT_S = 5.0  # after publishing
MOST = 10_000  # 2000 a second for so long


class Echoes:
    """Hashes of what was published lately, the oldest first: topic and payload."""

    def __init__(self) -> None:
        self._until: dict[int, float] = {}

    def add(self, topic: str, payload: bytes, now: float) -> None:
        self._forget(now)
        digest = hash((topic, payload))  # SipHash with a key of this process
        self._until.pop(digest, None)  # so that the last are the latest
        self._until[digest] = now + KEPT_S

    def holds(self, topic: str, payload: bytes, now: float) -> bool:
        return self._until.get(hash((topic, payload)), now) > now

    def _forget(self, now: float) -> None:
        while self._until:
            oldest = next(iter(self._until))
            if self._until[oldest] > now and len(self._until) < MOST:
                return
            del self._until[oldest]
