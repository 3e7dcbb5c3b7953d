"""Requests on their way to a broker: a bounded number, each answered once, at its deadline at the latest."""

import math
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from drivers.reason import Reason
from drivers.wire import v2n_talk as talk
from drivers.wire.v2n import Publication

# Of the fixed header, the topic's length, the packet's number and expiry: what a PUBLISH is longer than its parts.
OVERHEAD = 32


class Accepted(NamedTuple):
    """What a broker says when it accepts a connection.

    receive_maximum  publications that it takes without an acknowledgement.
    maximum_packet   octets.
    retains          whether it keeps messages.
    is_resumed       it still has what an earlier connection was subscribed to.
    """

    receive_maximum: int = 65535
    maximum_packet: int = 268_435_460
    maximum_qos: int = 2
    retains: bool = True
    is_resumed: bool = False


class _Request:
    """What the station has asked for and has not heard of yet.

    left  publications of it that are not acknowledged.
    """

    __slots__ = ("deadline", "is_answered", "left", "number")

    def __init__(self, number: int, deadline: float, left: int) -> None:
        self.number = number
        self.deadline = deadline
        self.left = left
        self.is_answered = False


class _Out(NamedTuple):
    """A publication without an acknowledgement; request is None for what the session says of itself."""

    request: _Request | None
    publication: Publication
    since: float
    qos: int  # by which it left


class Window:
    """What waits, and what the broker has not acknowledged.

    publish    hands a publication to the client; returns its token.
    takes_more  whether the client has written all that it was handed: what it has not, no deadline reaches.
    say        takes messages of v2n_talk for the station.
    size       publications without an acknowledgement, at most.
    confirmed  requests that the broker has. published: publications handed out, again included.
    """

    def __init__(
        self,
        publish: Callable[[Publication, float], int],
        takes_more: Callable[[], bool],
        say: Callable[[bytes], object],
        size: int,
    ) -> None:
        self.confirmed = self.published = 0
        self._publish = publish
        self._takes_more = takes_more
        self._say = say
        self._size = size
        self._requests: dict[int, _Request] = {}
        self._waiting: deque[tuple[_Request, Publication]] = deque()
        self._out: dict[int, _Out] = {}
        self._accepted: Accepted | None = None  # while there is a connection
        self._name = ""

    @property
    def unacknowledged(self) -> int:
        return len(self._out)

    @property
    def details(self) -> dict[str, object]:
        """For the status."""
        return {"published": self.published, "confirmed": self.confirmed, "unacknowledged": self.unacknowledged}

    def owed(self, limit_s: float) -> tuple[float, str]:
        """When it is too late for the oldest acknowledgement, and what the broker did not do."""
        for out in self._out.values():
            lacks = f"no PUBACK within {limit_s:g} s" if out.qos else f"reads nothing for {limit_s:g} s"
            return out.since + limit_s, lacks
        return math.inf, ""

    def is_full(self) -> bool:
        """Whether the station sends more than it may."""
        return len(self._requests) >= 2 * self._size

    def add(self, number: int, deadline: float, publications: list[Publication], now: float) -> None:
        """Take a request, and hand it out if there is room."""
        request = self._requests[number] = _Request(number, deadline, len(publications))
        self._waiting.extend((request, one) for one in publications)
        self.flush(now)

    def add_own(self, publication: Publication | None, now: float) -> None:
        """Hand out what the session says of itself, now or never.

        Where the broker takes no more without an acknowledgement it leaves by QoS 0, which needs none
        (MQTT 5.0, clause 3.3.4).
        """
        if publication is None or self._accepted is None:
            return
        fitted = self._fitted(publication)
        if len(self._out) >= self._accepted.receive_maximum:
            fitted = fitted._replace(qos=0)
        self._out[self._publish(fitted, now)] = _Out(None, publication, now, fitted.qos)

    def open(self, accepted: Accepted, name: str, own: Publication | None, now: float) -> None:
        """There is a connection: hand out what the session says of itself, then what waits. name is the broker's."""
        self._accepted = accepted
        self._name = name
        self.add_own(own, now)
        self.flush(now)

    def close(self) -> None:
        """The connection is gone: what is not acknowledged waits once more, in the order in which it left."""
        self._accepted = None
        again = [(out.request, out.publication) for out in self._out.values()]
        self._out.clear()
        self._waiting.extendleft((one, what) for one, what in reversed(again) if one and not one.is_answered)

    def published_one(self, token: int, why: str, now: float) -> None:
        """A publication was written (QoS 0) or acknowledged. why is empty, or why the broker refused it."""
        out = self._out.pop(token, None)
        if out is None:
            return
        request = out.request
        if request is not None and not request.is_answered:
            request.left -= 1
            if why:
                self._answer(request, Reason.SEND_FAILED, why)
            elif not request.left:
                self.confirmed += 1
                self._answer(request)
        if self._waiting:
            self.flush(now)

    def flush(self, now: float) -> None:
        """Hand out what waits, as much as may be without an acknowledgement."""
        accepted = self._accepted
        if accepted is None:
            return
        room = min(self._size, accepted.receive_maximum)
        while self._waiting and len(self._out) < room and self._takes_more():
            request, publication = self._waiting.popleft()
            left = request.deadline - now
            if request.is_answered or left <= 0:
                continue  # expire() answers
            if len(publication.payload) + len(publication.topic.encode()) + OVERHEAD > accepted.maximum_packet:
                limit = f"{self._name}: takes no packet of more than {accepted.maximum_packet} octets"
                self._answer(request, Reason.SEND_FAILED, limit)
            else:
                self.published += 1
                fitted = self._fitted(publication)
                token = self._publish(fitted._replace(expiry_s=_expiry_s(fitted, left)), now)
                self._out[token] = _Out(request, publication, now, fitted.qos)

    def deadline(self) -> float:
        return min((request.deadline for request in self._requests.values()), default=math.inf)

    def expire(self, now: float, why: str) -> None:
        """Answer what is too late. What is acknowledged later is not answered again, and counts until then."""
        late = [one for one in self._requests.values() if one.deadline <= now]
        for request in late:
            self._answer(request, Reason.EXPIRED, why)
        if late:
            self._waiting = deque(one for one in self._waiting if not one[0].is_answered)

    def _fitted(self, publication: Publication) -> Publication:
        """As the broker takes it."""
        accepted = self._accepted or Accepted()
        retain = publication.retain and accepted.retains
        return publication._replace(qos=min(publication.qos, accepted.maximum_qos), retain=retain)

    def _answer(self, request: _Request, reason: Reason | None = None, why: str = "") -> None:
        request.is_answered = True
        del self._requests[request.number]
        self._say(talk.sent(request.number, reason, why))


def _expiry_s(publication: Publication, left_s: float) -> int | None:
    """After which the broker forgets it: as its profile says; else, where it is not retained, what it has left to live.

    Whole seconds, and 1 at least (MQTT 5.0, clause 3.3.2.3.3).
    """
    if publication.retain or publication.expiry_s is not None:
        return publication.expiry_s
    return max(1, math.floor(left_s))
