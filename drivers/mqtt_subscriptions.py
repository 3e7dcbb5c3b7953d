"""What a station is subscribed to at a broker: follows what is wanted, one packet at a time, without a gap."""

import math
from collections.abc import Callable, Collection
from typing import Protocol

Filters = frozenset[tuple[str, int]]  # topic filters and their quality of service

# What the broker has refused to deliver is asked for again: its rules may have changed.
REFUSED_S = 60.0

SHOWN = 16  # subscriptions in status, of the many that tiles are


class Subscriber(Protocol):
    """The part of a client that is needed here."""

    def subscribe(self, filters: Collection[tuple[str, int]]) -> None: ...

    def unsubscribe(self, filters: Collection[str]) -> None: ...


class Subscriptions:
    """Those of one connection.

    wanted      tells what is wanted now.
    subscribed  what it has confirmed of that.
    refused     filters that it does not, and its words.
    """

    def __init__(self, client: Subscriber, wanted: Callable[[], Filters]) -> None:
        self.subscribed: Filters = frozenset()
        self.refused: dict[str, str] = {}
        self._client = client
        self._wanted = wanted
        self._asked: Filters = frozenset()
        self._leaving: frozenset[str] = frozenset()
        self._held: frozenset[str] = frozenset()  # filters: what it may deliver
        self._since = 0.0  # the last packet
        self._refused_since = 0.0

    def begin(self, is_resumed: bool) -> None:
        """A new connection asks for all that is wanted.

        is_resumed  the broker still has what the last one had. How far it came with what it has not acknowledged is
                    not known: what is not wanted of that is left.
        """
        self._held = self._held | _names(self._asked) if is_resumed else frozenset()
        self.subscribed = self._asked = frozenset()
        self._leaving = frozenset()
        self.refused = {}

    @property
    def details(self) -> dict[str, object]:
        """For the status."""
        names = sorted(name for name, _ in self.subscribed)
        return {"subscriptions": len(names), "first_subscriptions": names[:SHOWN]}

    @property
    def lacks(self) -> str:
        """What the broker does not deliver, in words; empty: nothing."""
        for name, words in sorted(self.refused.items()):
            more = len(self.refused) - 1
            return f"refuses subscription {name}{f' and {more} more' if more else ''}: {words}"
        return ""

    def awaits(self) -> tuple[str, float] | None:
        """The packet that the broker owes, and since when."""
        if self._asked:
            return "SUBACK", self._since
        return ("UNSUBACK", self._since) if self._leaving else None

    def owed(self, limit_s: float) -> tuple[float, str]:
        """When it is too late for that packet, and what the broker did not do."""
        awaited = self.awaits()
        return (awaited[1] + limit_s, f"no {awaited[0]} within {limit_s:g} s") if awaited else (math.inf, "")

    def follow(self, now: float) -> None:
        """Ask for what is not subscribed to yet, else leave what is not wanted any more."""
        if self._asked or self._leaving:
            return
        wanted = self._wanted()
        names = _names(wanted)
        self.refused = {name: why for name, why in self.refused.items() if name in names}
        self._since = now
        self._asked = frozenset(one for one in wanted - self.subscribed if one[0] not in self.refused)
        if self._asked:
            self._client.subscribe(sorted(self._asked))
            return
        self.subscribed &= wanted  # the same filter may be another, by its quality of service
        self._leaving = self._held - names
        if self._leaving:
            self._client.unsubscribe(sorted(self._leaving))

    def answered(self, refused: dict[str, str], now: float) -> None:
        """SUBACK: what it refuses, and its words."""
        asked, self._asked = self._asked, frozenset()
        if refused:
            self.refused |= refused
            self._refused_since = now
        given = frozenset(one for one in asked if one[0] not in refused)
        self.subscribed |= given
        self._held |= _names(given)
        self.follow(now)

    def left(self, now: float) -> None:
        """UNSUBACK."""
        self._held -= self._leaving
        self._leaving = frozenset()
        self.follow(now)

    def try_refused(self, now: float) -> None:
        """Ask once more for what was refused REFUSED_S ago."""
        if self.refused and not self._asked and now - self._refused_since >= REFUSED_S:
            self.refused = {}
            self.follow(now)


def _names(filters: Filters) -> frozenset[str]:
    return frozenset(name for name, _ in filters)
