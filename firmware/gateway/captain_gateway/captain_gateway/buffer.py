"""Queue of messages to send.

It keeps the latest message per station, event or sign, or all messages, and can repeat them.
"""

from collections import OrderedDict
from collections.abc import Hashable
from typing import Any, Generic, NamedTuple, TypeVar

from .settings import Transmit

Item = TypeVar("Item")


class _Waiting(NamedTuple):  # item is Any because a NamedTuple can be generic only since Python 3.11
    item: Any
    since: float
    is_sent: bool


class Buffer(Generic[Item]):
    """Queue of one handler with a send rate. put() is called at any time, due() once per period."""

    def __init__(self) -> None:
        self._latest: OrderedDict[Hashable, _Waiting] = OrderedDict()
        self._all: list[Item] = []

    def put(self, key: Hashable, item: Item, now: float, settings: Transmit) -> list[Item]:
        """Add an item. Returns the unsent items that this removes from the queue.

        With buffer `latest`, the item replaces the one with the same key. Beyond `depth` items the oldest is removed.
        now  time in seconds, of any monotonic clock.
        """
        if settings.buffer == "all":
            self._all.append(item)
            return [self._all.pop(0) for _ in range(len(self._all) - settings.depth)]
        before = self._latest.pop(key, None)
        self._latest[key] = _Waiting(item, now, False)
        gone = [] if before is None or before.is_sent else [before.item]
        while len(self._latest) > settings.depth:
            _, oldest = self._latest.popitem(last=False)
            gone += [] if oldest.is_sent else [oldest.item]
        return gone

    def due(self, now: float, settings: Transmit) -> list[Item]:
        """Return the items to send in this period: one of the queue `all`, and each item of the queue `latest`.

        An item of `latest` is returned again each period until it is older than `repeat_s`.
        """
        items = [self._all.pop(0)] if self._all else []
        for key, waiting in list(self._latest.items()):
            if waiting.is_sent and now - waiting.since > settings.repeat_s:
                del self._latest[key]
                continue
            items.append(waiting.item)
            if settings.repeat_s:
                self._latest[key] = waiting._replace(is_sent=True)
            else:
                del self._latest[key]
        return items

    def clear(self) -> list[Item]:
        """Empty the queue. Returns the items that were never sent."""
        left = [*self._all, *(waiting.item for waiting in self._latest.values() if not waiting.is_sent)]
        self._all.clear()
        self._latest.clear()
        return left
