"""Subscriptions at a broker: follow the wanted filters, one packet at a time."""

import math
from collections.abc import Callable, Collection
from typing import Protocol

Filters = frozenset[tuple[str, int]]  # topic filters and their quality of service

# Interval of retries for subscriptions that the broker has refused, because its rules may have changed.
REFUSED_S = 60.0

SHOWN = 16  # most subscriptions listed in status; a profile with tiles has many


class Subscriber(Protocol):
    """The calls of a session's client that Subscriptions needs."""

    def subscribe(self, filters: Collection[tuple[str, int]]) -> None: ...

    def unsubscribe(self, filters: Collection[str]) -> None: ...


class Subscriptions:
    """Subscriptions of one connection.

    wanted      function that returns the wanted filters.
    subscribed  wanted filters that the broker has acknowledged.
    refused     filters that the broker has refused, with its reasons in words.
    """

    def __init__(self, client: Subscriber, wanted: Callable[[], Filters]) -> None:
        self.subscribed: Filters = frozenset()
        self.refused: dict[str, str] = {}
        self._client = client
        self._wanted = wanted
        self._asked: Filters = frozenset()
        self._leaving: frozenset[str] = frozenset()
        self._held: frozenset[str] = frozenset()  # filters for which the broker may deliver messages
        self._since = 0.0  # time of the last packet
        self._refused_since = 0.0

    def begin(self, is_resumed: bool) -> None:
        """Start again for a new connection, so that follow() subscribes to all wanted filters.

        is_resumed  True: the broker has kept the subscriptions of the last connection. It may also have those that it
                    had not acknowledged. The unwanted ones of both are unsubscribed later.
        """
        self._held = self._held | _names(self._asked) if is_resumed else frozenset()
        self.subscribed = self._asked = frozenset()
        self._leaving = frozenset()
        self.refused = {}

    @property
    def details(self) -> dict[str, object]:
        """Details of the subscriptions for status."""
        names = sorted(name for name, _ in self.subscribed)
        return {"subscriptions": len(names), "first_subscriptions": names[:SHOWN]}

    @property
    def lacks(self) -> str:
        """Text that lists the refused subscriptions; empty if the broker has refused none."""
        for name, words in sorted(self.refused.items()):
            more = len(self.refused) - 1
            return f"refuses subscription {name}{f' and {more} more' if more else ''}: {words}"
        return ""

    def awaits(self) -> tuple[str, float] | None:
        """Return the packet that the broker must still send, and the time of its request; None without a request."""
        if self._asked:
            return "SUBACK", self._since
        return ("UNSUBACK", self._since) if self._leaving else None

    def owed(self, limit_s: float) -> tuple[float, str]:
        """Return the deadline of that packet, and the reason in words if it is missed; infinity without a request."""
        awaited = self.awaits()
        return (awaited[1] + limit_s, f"no {awaited[0]} within {limit_s:g} s") if awaited else (math.inf, "")

    def follow(self, now: float) -> None:
        """Subscribe to missing filters; if none is missing, unsubscribe from those not wanted any more.

        It does nothing while an answer of the broker is missing.
        """
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
        self.subscribed &= wanted  # also removes a filter that is wanted with another QoS now
        self._leaving = self._held - names
        if self._leaving:
            self._client.unsubscribe(sorted(self._leaving))

    def answered(self, refused: dict[str, str], now: float) -> None:
        """Handle SUBACK; refused: refused filters, with the broker's reasons in words."""
        asked, self._asked = self._asked, frozenset()
        if refused:
            self.refused |= refused
            self._refused_since = now
        given = frozenset(one for one in asked if one[0] not in refused)
        self.subscribed |= given
        self._held |= _names(given)
        self.follow(now)

    def left(self, now: float) -> None:
        """Handle UNSUBACK."""
        self._held -= self._leaving
        self._leaving = frozenset()
        self.follow(now)

    def try_refused(self, now: float) -> None:
        """Subscribe again to filters that were refused at least REFUSED_S ago."""
        if self.refused and not self._asked and now - self._refused_since >= REFUSED_S:
            self.refused = {}
            self.follow(now)


def _names(filters: Filters) -> frozenset[str]:
    return frozenset(name for name, _ in filters)
