"""Window of requests to a broker: bounded; answers each request once, at its deadline at the latest."""

import math
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from drivers.reason import Reason
from drivers.wire.v2n import talk
from drivers.wire.v2n.profile import Publication

# Octets by which a PUBLISH packet exceeds topic and payload: fixed header, topic length, packet identifier, expiry.
OVERHEAD = 32


class Accepted(NamedTuple):
    """Limits of a broker in its CONNACK.

    receive_maximum  most unacknowledged publications that the broker accepts.
    maximum_packet   length of the longest packet that it accepts, in octets.
    maximum_qos      highest QoS that it accepts.
    retains          True if it retains messages.
    is_resumed       True if it has kept the session of an earlier connection, with its subscriptions.
    """

    receive_maximum: int = 65535
    maximum_packet: int = 268_435_460
    maximum_qos: int = 2
    retains: bool = True
    is_resumed: bool = False


class _Request:
    """A request of the station.

    number       the station's number of the request.
    deadline     time at which it expires.
    left         number of its publications that are not acknowledged yet.
    is_answered  True after the answer to the station.
    """

    __slots__ = ("deadline", "is_answered", "left", "number")

    def __init__(self, number: int, deadline: float, left: int) -> None:
        self.number = number
        self.deadline = deadline
        self.left = left
        self.is_answered = False


class _Out(NamedTuple):
    """An unacknowledged publication.

    request  request that it belongs to; None for the session's own messages.
    since    time at which it was passed to the client.
    """

    request: _Request | None
    publication: Publication
    since: float
    qos: int  # QoS with which it was sent


class Window:
    """Publications that wait, and publications that the broker has not acknowledged.

    publish     passes a publication to the client; returns its token.
    takes_more  returns True if the client has written all its octets. Otherwise publications stay here, because one in
                the client cannot expire.
    say         passes a message of wire/v2n/talk.py to the station.
    size        most unacknowledged publications.
    confirmed   number of requests that the broker has acknowledged completely.
    published   number of publications passed to the client, repeated ones included.
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
        self._accepted: Accepted | None = None  # None without a connection
        self._name = ""

    @property
    def unacknowledged(self) -> int:
        return len(self._out)

    @property
    def details(self) -> dict[str, object]:
        """Details of the window for status."""
        return {"published": self.published, "confirmed": self.confirmed, "unacknowledged": self.unacknowledged}

    def owed(self, limit_s: float) -> tuple[float, str]:
        """Return the deadline of the oldest missing acknowledgement, and the reason in words if it is missed."""
        for out in self._out.values():
            lacks = f"no PUBACK within {limit_s:g} s" if out.qos else f"reads nothing for {limit_s:g} s"
            return out.since + limit_s, lacks
        return math.inf, ""

    def is_full(self) -> bool:
        """Return True if the station has more open requests than it may have."""
        return len(self._requests) >= 2 * self._size

    def add(self, number: int, deadline: float, publications: list[Publication], now: float) -> None:
        """Add a request with its publications; send them if the window has room."""
        request = self._requests[number] = _Request(number, deadline, len(publications))
        self._waiting.extend((request, one) for one in publications)
        self.flush(now)

    def add_own(self, publication: Publication | None, now: float) -> None:
        """Send a message of the session itself at once; without a connection it is discarded.

        If the broker accepts no more unacknowledged publications, it is sent with QoS 0, which needs no acknowledgement
        (MQTT 5.0, clause 3.3.4).
        """
        if publication is None or self._accepted is None:
            return
        fitted = self._fitted(publication)
        if len(self._out) >= self._accepted.receive_maximum:
            fitted = fitted._replace(qos=0)
        self._out[self._publish(fitted, now)] = _Out(None, publication, now, fitted.qos)

    def open(self, accepted: Accepted, name: str, own: Publication | None, now: float) -> None:
        """Start to send on a new connection: first the session's own message, then waiting publications.

        name  name of the broker, for answers.
        own   the session's own message; None without one.
        """
        self._accepted = accepted
        self._name = name
        self.add_own(own, now)
        self.flush(now)

    def close(self) -> None:
        """Stop sending after the end of a connection; unacknowledged publications wait again, in their order."""
        self._accepted = None
        again = [(out.request, out.publication) for out in self._out.values()]
        self._out.clear()
        self._waiting.extendleft((one, what) for one, what in reversed(again) if one and not one.is_answered)

    def published_one(self, token: int, why: str, now: float) -> None:
        """Take note that a publication was written (QoS 0), acknowledged or refused; why: the reason of a refusal."""
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
        """Send waiting publications, up to the limit of unacknowledged ones."""
        accepted = self._accepted
        if accepted is None:
            return
        room = min(self._size, accepted.receive_maximum)
        while self._waiting and len(self._out) < room and self._takes_more():
            request, publication = self._waiting.popleft()
            left = request.deadline - now
            if request.is_answered or left <= 0:
                continue  # expire() answers the request
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
        """Answer requests whose deadline has passed. Their sent publications count as unacknowledged until the end."""
        late = [one for one in self._requests.values() if one.deadline <= now]
        for request in late:
            self._answer(request, Reason.EXPIRED, why)
        if late:
            self._waiting = deque(one for one in self._waiting if not one[0].is_answered)

    def _fitted(self, publication: Publication) -> Publication:
        """Return the publication with a QoS and retain flag that the broker accepts."""
        accepted = self._accepted or Accepted()
        retain = publication.retain and accepted.retains
        return publication._replace(qos=min(publication.qos, accepted.maximum_qos), retain=retain)

    def _answer(self, request: _Request, reason: Reason | None = None, why: str = "") -> None:
        request.is_answered = True
        del self._requests[request.number]
        self._say(talk.sent(request.number, reason, why))


def _expiry_s(publication: Publication, left_s: float) -> int | None:
    """Return the message expiry in seconds: that of the profile, else the rest of the request's lifetime.

    A retained message without an expiry in the profile has none. The expiry is in whole seconds, at least 1 (MQTT 5.0,
    clause 3.3.2.3.3).
    """
    if publication.retain or publication.expiry_s is not None:
        return publication.expiry_s
    return max(1, math.floor(left_s))
