"""Topics that connections are subscribed to, counted so that no peer changes what another one asks for."""

from collections import Counter
from collections.abc import Callable, Container, Iterable

from firmware.peers.connection import Connection


class Interest:
    """Counts subscriptions to the station's topics.

    topics  of which on_change tells with each subscriber that comes, and when the last goes: topic, whether wanted.
    whole   topics as they are sent, of which takers has the number of subscriptions.
    costly  of topics, those that a subscription to everything does not ask for.

    libzmq passes on what a peer says: a subscription twice, the end of one that the peer never had. So each connection
    has a set of its own, and only what changes that is counted. The end of a connection ends what is in its set.
    """

    def __init__(
        self,
        topics: Iterable[bytes],
        whole: Iterable[bytes],
        costly: Container[bytes],
        on_change: Callable[[bytes, bool], None],
    ) -> None:
        self.takers = dict.fromkeys(whole, 0)
        self.total = 0
        self.by_address: Counter[str] = Counter()
        self._counts = dict.fromkeys(topics, 0)
        self._costly = costly
        self._on_change = on_change
        # Of takers and of topics: those that add() has counted. Never reduced.
        self._lasting_takers: set[bytes] = set()
        self._lasting: set[bytes] = set()

    def subscribe(self, connection: Connection, topic: bytes) -> None:
        if topic not in connection.topics:
            connection.topics.add(topic)
            self._number(connection, 1)
            self._step(topic, 1)

    def unsubscribe(self, connection: Connection, topic: bytes) -> None:
        if topic in connection.topics:
            connection.topics.discard(topic)
            self._number(connection, -1)
            self._step(topic, -1)

    def end(self, connection: Connection) -> None:
        """Take back all that it is subscribed to."""
        for topic in list(connection.topics):
            self.unsubscribe(connection, topic)

    def add(self, prefix: bytes) -> None:
        """Count a subscription without a descriptor for ever, once for each of the station's topics.

        libzmq tells no descriptor of a peer of ZMTP 2.0 (15/ZMTP), which has no metadata. Without one it also tells
        the end of each topic of a connection that has ended, whoever it was. So nobody knows when such interest ends.
        """
        for topic in self.takers:
            if topic not in self._lasting_takers and topic.startswith(prefix):
                self._lasting_takers.add(topic)
                self.takers[topic] += 1
        for topic in self._counts:
            if self._is_asked(topic, prefix):
                if topic not in self._lasting:
                    self._lasting.add(topic)
                    self._counts[topic] += 1
                self._on_change(topic, True)

    def _number(self, connection: Connection, step: int) -> None:
        self.total += step
        self.by_address[connection.address] += step
        if not self.by_address[connection.address]:
            del self.by_address[connection.address]

    def _step(self, prefix: bytes, step: int) -> None:
        # These first: who hears of interest may send at once.
        for topic, before in self.takers.items():
            if topic.startswith(prefix):
                self.takers[topic] = before + step
        for topic, before in self._counts.items():
            if self._is_asked(topic, prefix):
                after = self._counts[topic] = before + step
                if step > 0 or not after:
                    self._on_change(topic, after > 0)

    def _is_asked(self, topic: bytes, prefix: bytes) -> bool:
        """Whether a subscription to prefix asks for some message of topic."""
        if not prefix:
            return topic not in self._costly
        return topic.startswith(prefix) or prefix.startswith(topic)
