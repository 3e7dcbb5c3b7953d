"""Interest: counts subscriptions per connection, so that no peer changes those of another."""

from collections import Counter
from collections.abc import Callable, Collection, Iterable
from typing import NamedTuple

from firmware.endpoint.peers.connection import Connection


class CountedTopics(NamedTuple):
    """Topics whose subscriptions a socket counts.

    topics     topic prefixes for which on_change is called.
    on_change  called with topic and True for each new subscription, and with False when the last one ends.
    whole      complete topics, as they are sent; Interest.takers has the number of subscriptions to each.
    costly     topics that a subscription to the empty prefix (everything) does not count for.
    """

    topics: Iterable[bytes] = ()
    on_change: Callable[[bytes, bool], None] = lambda topic, is_wanted: None
    whole: Iterable[bytes] = ()
    costly: Iterable[bytes] = ()


class Interest:
    """Counts subscriptions to the topics of one socket.

    libzmq passes on whatever a peer sends: the same subscription twice, or the end of one that never began. Each
    connection therefore has its own set of topics, and only changes of this set count. The end of a connection ends the
    subscriptions in its set.
    """

    def __init__(self, counted: CountedTopics) -> None:
        topics, on_change, whole, costly = counted
        self.takers = dict.fromkeys(whole, 0)
        self.total = 0
        self.by_address: Counter[str] = Counter()
        self._counts = dict.fromkeys(topics, 0)
        self._costly = set(costly)
        self._on_change = on_change
        # Topics that add() has counted permanently: those among takers, and those for which on_change is called.
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
        """Remove all subscriptions of a connection."""
        for topic in list(connection.topics):
            self.unsubscribe(connection, topic)

    def add(self, prefix: bytes) -> None:
        """Count a subscription of an unknown connection, permanently and once for each of the station's topics.

        For peers of ZMTP 2.0 (15/ZMTP), which has no metadata, libzmq does not name the connection. When any
        connection ends, libzmq reports its unsubscriptions without a name as well. This class therefore cannot tell
        when such a subscription ends.
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

    def add_costly(self, topics: Iterable[bytes], prefixes: Collection[bytes]) -> None:
        """Count subscriptions to further costly topics: those to the prefixes, and later ones."""
        for topic in topics:
            self._costly.add(topic)
            self._counts[topic] = sum(self._is_asked(topic, prefix) for prefix in prefixes)
            if self._counts[topic]:
                self._on_change(topic, True)

    def add_whole(self, topic: bytes, prefixes: Collection[bytes]) -> None:
        """Count subscriptions to a further complete topic: those to the prefixes, and later ones."""
        self.takers[topic] = sum(topic.startswith(prefix) for prefix in prefixes)

    def _number(self, connection: Connection, step: int) -> None:
        self.total += step
        self.by_address[connection.address] += step
        if not self.by_address[connection.address]:
            del self.by_address[connection.address]

    def _step(self, prefix: bytes, step: int) -> None:
        # takers must be up to date before on_change is called, which may send a message.
        for topic, before in self.takers.items():
            if topic.startswith(prefix):
                self.takers[topic] = before + step
        for topic, before in self._counts.items():
            if self._is_asked(topic, prefix):
                after = self._counts[topic] = before + step
                if step > 0 or not after:
                    self._on_change(topic, after > 0)

    def _is_asked(self, topic: bytes, prefix: bytes) -> bool:
        """Return True if a subscription to `prefix` includes messages of `topic`."""
        if not prefix:
            return topic not in self._costly
        return topic.startswith(prefix) or prefix.startswith(topic)
