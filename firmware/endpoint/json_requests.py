"""Requests in JSON: wait for the facilities process, and become requests of the router when they are encoded.

# request of a user -> waiting -> given to the process (at most WINDOW) -> answered: sent, or refused with its faults

When the process dies, the given requests are refused as `facilities-restarting`, and the waiting ones are given to the
next process. A request leaves once or never, because the router gets a PDU only with an answer. The window is small, so
that a death costs few requests. A process that dies before it could take requests ends the waiting ones, too.
"""

from collections import deque
from collections.abc import Callable, Sequence
from typing import NamedTuple

from drivers.message import MAX_PDU, Fault, MessageType
from drivers.reason import Reason
from firmware.facilities.exchange import MAX_BODY, Ask
from firmware.routing.options import Parsed
from firmware.routing.router import Routing

# Seconds for which a request without `lifetime_s` may wait. A process that dies again and again starts with a back-off.
WAIT_S = 10.0
WINDOW = 8  # requests that the process has at once: enough to keep it busy
# Requests and octets that wait. The process encodes thousands per second; a start takes half a second.
MOST, MOST_OCTETS = 1_024, 4 << 20


class Pending(NamedTuple):
    """A request without an answer.

    kind   type of the envelope; None for `v2x.`.
    place  socket that received it, as place for the drop counters.
    until  time on the loop's clock until which it may wait for the process.
    """

    number: int
    kind: MessageType | None
    body: bytes
    place: str
    asked: Parsed
    until: float


class JsonRequests:
    """Requests of users in JSON.

    give        gives a request to the process; returns False if the process does not take it now.
    station_id  own stationID, for messages without a header.
    """

    def __init__(self, routing: Routing, give: Callable[[Ask], bool], station_id: int) -> None:
        self.total = 0
        self._router = routing.router
        self._clock = routing.loop.clock
        self._by_envelope = routing.topics.by_envelope
        self._give = give
        self._station_id = station_id
        self._octets = 0  # octets of the waiting requests
        self._waiting: deque[Pending] = deque()
        self._given: dict[int, Pending] = {}

    def __len__(self) -> int:
        return len(self._waiting) + len(self._given)

    def add(self, kind: MessageType | None, body: bytes, place: str, asked: Parsed) -> None:
        """Queue a request; refuse it if it is too long, or if too many wait."""
        self.total += 1
        until = self._clock() + (asked.options.lifetime_s or WAIT_S)
        pending = Pending(self.total, kind, body, place, asked, until)
        if len(body) > MAX_BODY:
            self._refuse(pending, Reason.BAD_JSON, f"JSON of {len(body)} octets; at most {MAX_BODY}")
        elif len(self._waiting) >= MOST or self._octets + len(body) > MOST_OCTETS:
            self._refuse(pending, Reason.FACILITIES_BUSY, f"{len(self._waiting)} requests wait")
        else:
            self._waiting.append(pending)
            self._octets += len(body)

    def go_on(self) -> None:
        """Give waiting requests to the process."""
        while self._waiting and self._waiting[0].until < self._clock():
            self._refuse(self._taken(), Reason.EXPIRED, "it waited for the facilities process")
        while self._waiting and len(self._given) < WINDOW and self._give(self._ask(self._waiting[0])):
            pending = self._taken()
            self._given[pending.number] = pending

    def encoded(self, number: int, pdu: bytes, name: str) -> None:
        """Take the PDU of a request and its type, and send it."""
        pending = self._given.pop(number)
        kind = pending.kind or self._by_envelope.get(b"v2x.%s." % name.encode())
        if kind is None:
            self._refuse(pending, Reason.UNKNOWN_TYPE, f"type {name}")
        elif len(pdu) > MAX_PDU:
            self._refuse(pending._replace(body=pdu), Reason.LONG_PDU, f"{len(pdu)} octets", kind)
        else:
            self._router.request(kind, pdu, pending.place, pending.asked)

    def refused(self, number: int, reason: str, detail: str, faults: Sequence[Fault]) -> None:
        """Take the faults of a request, and refuse it."""
        self._refuse(self._given.pop(number), Reason(reason), detail, faults=faults)

    def end(self, reason: Reason, detail: str, is_all: bool) -> None:
        """Refuse the given requests, and with is_all the waiting ones as well."""
        ended = list(self._given.values())
        self._given.clear()
        if is_all:
            ended += self._waiting
            self._waiting.clear()
            self._octets = 0
        for pending in ended:
            self._refuse(pending, reason, detail)

    def _taken(self) -> Pending:
        pending = self._waiting.popleft()
        self._octets -= len(pending.body)
        return pending

    def _ask(self, pending: Pending) -> Ask:
        ego = self._router.ego()
        latitude, longitude = ego.position if ego.is_known else (None, None)
        kind, form = pending.kind, pending.asked.options.form
        its_ms = self._router.its_ms()
        name, message_id = ("", -1) if kind is None else (kind.name, kind.number)
        return Ask(pending.number, name, message_id, form, pending.body, self._station_id, its_ms, latitude, longitude)

    def _refuse(
        self,
        pending: Pending,
        reason: Reason,
        detail: str,
        kind: MessageType | None = None,
        faults: Sequence[Fault] = (),
    ) -> None:
        label = pending.asked.options.label
        kind = kind or pending.kind
        self._router.refuse_message(reason, pending.body, pending.place, kind, label, detail, faults)
