"""What waits to be sent: the latest of each thing, or all of them; and what is sent again."""

from collections import OrderedDict
from collections.abc import Hashable
from typing import Any, Generic, NamedTuple, TypeVar

from .settings import Transmit

Item = TypeVar("Item")


class _Waiting(NamedTuple):  # of items; a NamedTuple is generic since Python 3.11
    item: Any
    since: float
    is_sent: bool


class Buffer(Generic[Item]):
    """Of one handler that has a rate: put() at any time, due() once in a period."""

    def __init__(self) -> None:
        self._latest: OrderedDict[Hashable, _Waiting] = OrderedDict()
        self._all: list[Item] = []

    def put(self, key: Hashable, item: Item, now: float, settings: Transmit) -> list[Item]:
        """Take one. Returns those that are never sent for it: the one that it replaces, or the oldest."""
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
        """What is to be sent in this period: the first of all, and of what is kept the latest of each thing."""
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
        """Everything that has not been sent."""
        left = [*self._all, *(waiting.item for waiting in self._latest.values() if not waiting.is_sent)]
        self._all.clear()
        self._latest.clear()
        return left
