"""Facilities process of the endpoint: JSON of users to PDUs, and received messages to JSON.

The first request in JSON, or the first subscription to `json.` or `plain.`, starts the process; a dead one restarts.
Received messages that a slow or dying process does not convert are counted at the place `json`.
"""

import logging
from typing import cast

import zmq

from board.runtime.worker import Worker
from drivers.message import Fault, Indication, MessageType
from drivers.reason import Reason
from firmware.endpoint.feed import Feed, types_of
from firmware.endpoint.json_requests import JsonRequests
from firmware.endpoint.publisher import Publisher
from firmware.facilities.exchange import Ask, packed, parts_of
from firmware.routing.options import Parsed
from firmware.routing.router import Routing

WORKER = "facilities"
PLACE = "json"
STEADY_S = 1.0  # users wait for it: a process that has worked for a second starts again at once

log = logging.getLogger("captain.facilities")


class Facilities:
    """Owner of the facilities process.

    reports     publisher of port 5558.
    station_id  own stationID, for messages without a header.
    """

    def __init__(
        self, routing: Routing, context: zmq.Context[zmq.Socket[bytes]], reports: Publisher, station_id: int
    ) -> None:
        self._drops = routing.drops
        self._context = context
        self._reports = reports
        self._requests = JsonRequests(routing, self._give, station_id)
        self._wanted: set[bytes] = set()
        self._types: frozenset[str] = frozenset()  # types whose JSON a user wants
        self._feed: Feed | None = None
        self._made = self._lost = 0
        self._told_done = self._told_lost = 0  # numbers that the process has reported since its start
        self._why = "starting"
        self._was_up = False
        self._has_heard = False
        self._is_told = True
        self._worker = Worker(routing.loop, WORKER, self._message, self._changed, self._writable)
        self._worker.steady_s = STEADY_S

    def request(self, kind: MessageType | None, body: bytes, place: str, asked: Parsed) -> None:
        """Encode the JSON of a user and send it. Every outcome is reported as a confirm.

        kind   type of the envelope; None for `v2x.`: the edition or the header decides.
        body   JSON object, in the form that the options name.
        place  socket that received it, for the drop counters.
        """
        self._requests.add(kind, body, place, asked)
        self._worker.start()
        self._requests.go_on()

    def want(self, topic: bytes, is_wanted: bool) -> None:
        """Start or stop a topic: its first subscriber came, or its last one left."""
        (self._wanted.add if is_wanted else self._wanted.discard)(topic)
        self._types = types_of(self._wanted)
        if is_wanted:
            if self._feed is None:
                self._feed = Feed(self._context)
            self._worker.start()
        if self._worker.is_up:
            self._tell_wanted()

    def publish(self, indications: list[Indication], sequences: list[int]) -> None:
        """Give those received messages to the process whose JSON a user wants."""
        if self._feed is None:
            return
        for one, sequence in zip(indications, sequences, strict=True):
            if one.kind.name not in self._types:
                continue
            if self._worker.is_up and self._feed.send(one, sequence):
                self._has_heard = True
            elif self._has_heard:  # else it is the first process that starts, and the subscription begins with it
                self._count_lost(1, Reason.FACILITIES_RESTARTING, one.pdu)

    def status(self) -> dict[str, object]:
        """Return the part of the status about JSON.

        is_running  true while the process runs.
        why         state of the process, in words.
        restarts    number of restarts of the process.
        requests    number of requests in JSON.
        waiting     number of these that have no answer of the process yet.
        made        number of objects published on `json.<type>.` and `plain.<type>.`.
        lost        number of received messages that were not converted: the process was too slow, or died.
        """
        return {
            "is_running": self._worker.is_up,
            "why": self._why,
            "restarts": self._worker.restarts,
            "requests": self._requests.total,
            "waiting": len(self._requests),
            "made": self._made,
            "lost": self._lost,
        }

    def finish(self) -> None:
        """Refuse the requests without an answer and end the process, because the station stops."""
        self._requests.end(Reason.STOPPED, "", is_all=True)
        self._worker.finish()
        if self._feed is not None:
            self._feed.close()
            self._feed = None

    def _give(self, ask: Ask) -> bool:
        return self._worker.is_up and self._worker.send(packed("ask", tuple(ask)))

    def _tell_wanted(self) -> None:
        """Tell the process the topics; again when its queue has room, if it was full."""
        if self._feed is not None:
            self._is_told = self._worker.send(packed("want", self._feed.address, tuple(self._wanted)))

    def _writable(self) -> None:
        if not self._is_told:
            self._tell_wanted()

    def _changed(self, is_up: bool, why: str) -> None:
        self._why = why
        log.log(logging.INFO if is_up else logging.WARNING, "%s", why)
        if is_up:
            self._told_done = self._told_lost = 0
            if self._feed is not None:
                self._feed.begin()
            self._tell_wanted()
        else:
            if self._feed is not None and self._was_up:
                self._count_lost(self._feed.sent - self._told_done, Reason.FACILITIES_RESTARTING)
            self._requests.end(Reason.FACILITIES_RESTARTING, why, is_all=not self._was_up)
        self._was_up = is_up
        self._requests.go_on()

    def _message(self, message: bytes) -> None:
        kind, *parts = parts_of(message)
        if kind == "pdu":
            self._requests.encoded(*cast("tuple[int, bytes, str]", parts))
        elif kind == "refused":
            self._requests.refused(*cast("tuple[int, str, str, tuple[Fault, ...]]", parts))
        elif kind == "json":
            self._made += 1
            self._reports.publish(*cast("tuple[bytes, bytes]", parts))
        else:
            self._told_done, lost = cast("tuple[int, int]", parts)
            self._count_lost(lost - self._told_lost, Reason.FACILITIES_BUSY)
            self._told_lost = lost
        self._requests.go_on()

    def _count_lost(self, count: int, reason: Reason, pdu: bytes = b"") -> None:
        if count > 0:
            self._lost += count
            self._drops.count(PLACE, reason, pdu, count, self._why)
