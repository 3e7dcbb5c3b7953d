"""Endpoint: the four ports for users, and the control socket of the command line."""

import os
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import zmq

from board.runtime.errors import StationError
from drivers.contract import Witness
from drivers.message import Ego, MessageType
from firmware.config.tables import EndpointOptions
from firmware.endpoint.control.control_socket import ControlSocket, default_path
from firmware.endpoint.control.question import Commands
from firmware.endpoint.inlet import Inlet
from firmware.endpoint.peers.guard import Guard
from firmware.endpoint.peers.interest import CountedTopics
from firmware.endpoint.publisher import Publisher
from firmware.endpoint.report import CONFIRM, FRAME, IMPLAUSIBLE, INDICATION, SOON, STATUS, TIME, TOPICS, Report
from firmware.endpoint.users import Users
from firmware.routing.options import Parsed
from firmware.routing.router import ConfirmListener, Observer, Routing
from firmware.topics import JSON_FORMS

if TYPE_CHECKING:
    from firmware.endpoint.deliveries import Deliveries
    from firmware.endpoint.facilities import Facilities
    from firmware.endpoint.frames import Frames

# Seconds. A stopping station still takes the messages that users have already sent, for at most this long.
FINISH_S = 0.2
# First words of the topics of each type: those of `deliveries` and `facilities`.
WORDS_OF_TYPES = ("message", *JSON_FORMS)


class StationQueries(NamedTuple):
    """Functions of the station that the endpoint calls.

    local        returns the own position for localInfo of RawRxMessage; None omits localInfo.
    status       returns the status object.
    refresh      updates the counters in the status from the kernel.
    time_status  returns the part of the status about time.
    commands     commands that the control socket offers.
    station_id   own stationID, for messages in JSON without a header.
    """

    local: Callable[[], Ego] | None
    status: Callable[[], dict[str, object]]
    refresh: Callable[[], None]
    time_status: Callable[[], dict[str, object]]
    commands: Commands
    station_id: int


class Endpoint:
    """All sockets for users: to_users, from_users, pull, report and the control socket.

    mac           the station's own MAC address.
    witness       object shared with the interfaces; holds the listener for their whole frames.
    has_recorder  True binds the report port to a second, private address as well: private_report.

    Raises StationError if a socket cannot be opened; the sockets opened before it are closed.
    """

    def __init__(
        self,
        routing: Routing,
        options: EndpointOptions,
        station: StationQueries,
        mac: bytes,
        witness: Witness,
        has_recorder: bool = False,
    ) -> None:
        self.context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        loop, topics, drops, router = routing
        self._loop = loop
        self._router = router
        self._drops = drops
        self._mac = mac
        self._witness = witness
        self._wanted: set[bytes] = set()  # topics of the report port
        self._frames: Frames | None = None
        self._facilities: Facilities | None = None
        self._deliveries: Deliveries | None = None
        self._routing = routing
        self._station_id = station.station_id
        self._are_frames_shown = False
        self.private_report = f"ipc://@captain-{os.urandom(8).hex()}" if has_recorder else ""
        host = f"[{options.address}]" if ":" in options.address else options.address

        def at(port: int) -> str:
            return f"tcp://{host}:{port}"

        try:
            self.users = Users(loop, self.context, at(options.to_users), topics, drops, station.local)
            of_types = topics.of_each_type(*WORDS_OF_TYPES)
            costly = (IMPLAUSIBLE, FRAME, SOON, *of_types)
            counted = CountedTopics((*TOPICS, *of_types), self._interest, costly=costly)
            also = [self.private_report] if has_recorder else []
            self._reports = Publisher(loop, self.context, at(options.report), "report", drops, counted, also)
            self.report = Report(
                loop, self._reports, station.status, station.refresh, station.time_status, router.quality_now
            )
            self.inlets = [
                Inlet(routing, self.context, kind, at(port), name, json, options.strict)
                for kind, port, name, json in (
                    (zmq.SUB, options.from_users, "from_users", None),
                    (zmq.PULL, options.pull, "pull", self),
                )
            ]
            self._control = ControlSocket(loop, options.control or default_path(options.from_users), station.commands)
        except StationError:
            self.context.destroy(linger=0)  # the sockets that were opened
            raise
        self._guard = Guard(loop, self.inlets, (self.users.publisher, self._reports))
        router.users = self.users

    def start(self) -> None:
        self.users.start()
        self.report.start()

    def finish(self) -> None:
        """Take the messages that users have already sent, then close the sockets that receive them."""
        until = self._loop.clock() + FINISH_S
        for inlet in self.inlets:
            inlet.finish(until)
        if self._facilities is not None:
            self._facilities.finish()

    def close_inlets(self) -> None:
        for inlet in self.inlets:
            inlet.close()

    def finish_reports(self) -> None:
        """Publish all queued reports and frame reports."""
        self.report.finish()
        if self._frames is not None:
            self._frames.finish()

    def close(self) -> None:
        """Close all sockets. libzmq still sends queued messages within its linger time."""
        if self._facilities is not None:
            self._facilities.finish()
        self.finish_reports()
        self._control.close()
        self.users.publisher.close()
        self._reports.close()
        self._guard.close()
        self.context.term()

    def request(self, kind: MessageType | None, body: bytes, where: str, asked: Parsed) -> None:
        """Encode a message in JSON and send it. kind: type of its envelope; None for `v2x.`."""
        self._facilities_on_demand().request(kind, body, where, asked)

    def add_kind(self, kind: MessageType) -> None:
        """Take a type that was added to the table of types."""
        self._reports.add_costly(f"{word}.{kind.name}.".encode() for word in WORDS_OF_TYPES)

    def status(self) -> dict[str, object]:
        """Return the parts of the status about users and reports.

        endpoint.requests     number of requests of users, and of applications at brokers.
        endpoint.accepted     number of accepted requests.
        endpoint.published    number of PDUs that were published on port 5556.
        endpoint.raw          number of RawRxMessages that were published on port 5556.
        endpoint.slow_since   Unix time since a subscriber of port 5556 is slow; null while all keep up.
        endpoint.slow_count   number of times that a subscriber of port 5556 became slow.
        endpoint.connections  number of open connections, by socket.
        report.slow_since     Unix time since a subscriber of port 5558 is slow; null while all keep up.
        report.slow_count     number of times that a subscriber of port 5558 became slow.
        report.confirms       `sequence` of the last confirm.
        report.indications    `sequence` of the last indication.
        report.frames         `total` of each interface's frames.
        facilities            conversion of JSON; absent before its first use.
        """
        publisher = self.users.publisher
        return {
            "endpoint": {
                "requests": self._router.requests,
                "accepted": self._router.accepted,
                "published": self.users.published,
                "raw": self.users.raw,
                "slow_since": publisher.slow_since,
                "slow_count": publisher.slow_count,
                "connections": self._guard.status(),
            },
            "report": {
                "slow_since": self._reports.slow_since,
                "slow_count": self._reports.slow_count,
                "confirms": self.report.confirms,
                "indications": self.report.indications,
                "frames": {} if self._frames is None else self._frames.totals(),
            },
            **({"facilities": self._facilities.status()} if self._facilities is not None else {}),
        }

    def _interest(self, topic: bytes, is_wanted: bool) -> None:
        """Start or stop a kind of report: the first subscriber of its topic came, or the last one left."""
        was_wanted = topic in self._wanted
        (self._wanted.add if is_wanted else self._wanted.discard)(topic)
        if topic == STATUS:
            self.report.status_interest(is_wanted)
        elif topic == TIME:
            self.report.time_interest(is_wanted)
        elif topic == SOON:
            self.report.is_hurried = is_wanted
        elif topic == FRAME:
            if is_wanted is not was_wanted:
                self._look_at_frames(is_wanted)
        elif topic.startswith(b"message."):
            self._deliveries_on_demand().want(topic, is_wanted)
        elif topic.startswith((b"json.", b"plain.")):
            self._facilities_on_demand().want(topic, is_wanted)
        else:
            self._look_at_messages()

    def _facilities_on_demand(self) -> "Facilities":
        if self._facilities is None:
            from firmware.endpoint.facilities import Facilities  # imported on demand, as few stations need JSON

            self._facilities = Facilities(self._routing, self.context, self._reports, self._station_id)
            self.users.listeners.append(self._facilities)
        return self._facilities

    def _deliveries_on_demand(self) -> "Deliveries":
        if self._deliveries is None:
            from firmware.endpoint.deliveries import Deliveries

            self._deliveries = Deliveries(self._loop, self._reports, self._drops)
            self.users.listeners.append(self._deliveries)
        return self._deliveries

    def _look_at_frames(self, is_wanted: bool) -> None:
        if self._frames is None:
            from firmware.endpoint.frames import Frames  # imported on demand, as few stations record frames

            publish = self._reports.publish_both
            self._frames = Frames(
                self._loop,
                publish,
                self._router,
                self._mac,
                self._drops,
                self._show_frames,
                is_counting=bool(self.private_report),
            )
        (self._frames.resume if is_wanted else self._frames.forget)()
        self._drops.listener = self._frames if is_wanted else None
        self._show_frames(is_wanted)

    def _show_frames(self, is_wanted: bool) -> None:
        self._are_frames_shown = is_wanted
        self._witness.watch = self._frames if is_wanted else None
        self._look_at_messages()

    def _look_at_messages(self) -> None:
        """Register those reports that have subscribers with the router; the others then cost no time per message."""
        report, wanted = self.report, self._wanted
        observers: list[Observer] = [report] if INDICATION in wanted else []
        if IMPLAUSIBLE in wanted:
            observers.append(report.implausible)
        confirm_listeners: list[ConfirmListener] = [report] if CONFIRM in wanted else []
        if self._frames is not None and self._are_frames_shown:
            observers.append(self._frames)
            confirm_listeners.append(self._frames)
        self._router.set_listeners(observers, confirm_listeners)
