"""Router: passes indications to users, and requests to interfaces by the policy."""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Protocol

from board.runtime.loop import Loop
from board.time.scales import TimeQuality
from drivers.contract import Can
from drivers.message import UNKNOWN_TIME, Confirm, Ego, Fault, Indication, MessageType, Outcome, Request
from drivers.reason import Reason
from firmware.routing.drops import Drops
from firmware.routing.interface import Interface
from firmware.routing.options import NOTHING_ASKED, Parsed
from firmware.routing.policy import CompiledRow, Policy
from firmware.topics import Topics

_new = tuple.__new__
DEFAULT_HOP_LIMIT = 10  # itsGnDefaultHopLimit, EN 302 636-4-1 V1.4.1 Annex H
BURST = 32  # number of indications that are passed on together at most: about 0.2 ms of a flood
Stage = Callable[[list[Indication]], list[Indication]]
RequestStage = Callable[[Request], Request | Reason]


class UserSide(Protocol):
    """Publisher of received messages (firmware.endpoint.users.Users)."""

    def publish(self, indications: list[Indication]) -> None:
        """Publish indications; slow subscribers do not delay this call."""


class Observer(Protocol):
    """Receiver of all indications, before any routing stage can drop them."""

    def observe(self, indications: list[Indication]) -> None: ...


class ConfirmListener(Protocol):
    """Receiver of the outcomes of each request."""

    def confirm(self, confirm: Confirm, targets: tuple[Interface, ...]) -> None:
        """Take a confirm. targets: interfaces of an accepted request; else empty."""


class QualitySource(Protocol):
    """Updater of Router.quality and Router.quality_until (the station's timekeeper)."""

    def renew(self) -> None: ...


class Router:
    """Router of indications to users and of requests to interfaces.

    users           publisher of indications that have passed the stages; None until the endpoint is open.
    quality         quality of the station's time in this second, copied into indications.
    quality_until   time on the loop's clock until which quality is valid.
    quality_source  renews quality when it is used after quality_until, which happens if the loop is late.
    ego             returns own time and position.
    its_ms          returns own ITS time in ms; 0 if unknown.
    stages          functions applied to indications in order. Each returns the indications to pass on, and counts the
                    others as drops.
    request_stages  functions applied to a request after the policy. Each returns the request, or a reason to refuse it.

    All indications of one turn of the loop are passed on together. Each stage is then called once per turn, and the I/O
    thread of libzmq wakes only once.
    """

    def __init__(
        self, loop: Loop, topics: Topics, drops: Drops, ego: Callable[[], Ego], its_ms: Callable[[], int]
    ) -> None:
        self.is_confirm_wanted = False
        self.interfaces: dict[str, Interface] = {}
        self.stages: Sequence[Stage] = ()
        self.request_stages: Sequence[RequestStage] = ()
        self.users: UserSide | None = None
        self._observers: Sequence[Observer] = ()
        self._confirm_listeners: Sequence[ConfirmListener] = ()
        self.quality: TimeQuality = UNKNOWN_TIME
        self.quality_until = math.inf
        self.quality_source: QualitySource | None = None
        self.ego = ego
        self.its_ms = its_ms
        self.policy = Policy((), topics, self)
        self.requests = 0
        self.accepted = 0
        self._loop = loop
        self._clock = loop.clock
        self._burst: list[Indication] = []
        self._unknown = topics.unknown
        self._drops = drops
        self._targets: dict[CompiledRow, tuple[Interface, ...]] = {}

    def add(self, interface: Interface) -> None:
        self.interfaces[interface.name] = interface
        self._targets.clear()

    def set_policy(self, policy: Policy) -> None:
        """Replace the policy. Queues, connections and the counts of rows with the same name are kept."""
        counts = {row.name: row.matched for row in self.policy.rows}
        for row in policy.rows:
            row.matched = counts.get(row.name, 0)
        self.policy = policy
        self._targets.clear()

    def add_kind(self, kind: MessageType) -> None:
        """Take a type that was added to the table of types."""
        self.policy.add_kind(kind)
        for interface in self.interfaces.values():
            interface.add_kind()

    def set_listeners(self, observers: Sequence[Observer], confirm_listeners: Sequence[ConfirmListener]) -> None:
        """Replace all listeners. Without listeners, no time is spent on reports."""
        self._observers, self._confirm_listeners = observers, confirm_listeners
        self.is_confirm_wanted = bool(confirm_listeners)

    # Called by interfaces: firmware.routing.interface.UpperLayer.

    def indicate(self, indication: Indication) -> None:
        """Queue an indication. It is passed on after this turn of the loop, or as soon as BURST have been queued."""
        burst = self._burst
        if not burst:
            self._loop.soon(self.flush)
        burst.append(indication)
        if len(burst) >= BURST:
            self.flush()

    def renewed_quality(self) -> TimeQuality:
        if self.quality_source is not None:
            self.quality_source.renew()
        return self.quality

    def quality_now(self) -> TimeQuality:
        return self.quality if self._clock() < self.quality_until else self.renewed_quality()

    def flush(self) -> None:
        """Pass on the queued indications: to observers, through the stages, to users."""
        burst = self._burst
        if burst:
            self._burst = []
            for observer in self._observers:
                observer.observe(burst)
            if self.policy.received:
                burst = [one for one in burst if not (one.rx.implausible and self._is_refused(one))]
            for stage in self.stages:
                burst = stage(burst)
            if self.users is not None:
                self.users.publish(burst)

    def _is_refused(self, one: Indication) -> bool:
        """Drop an implausible message if the policy refuses it. Return True if it was dropped.

        This comes before duplicate suppression, so that an implausible copy cannot suppress a plausible one.
        """
        if not self.policy.refuses(one):
            return False
        self._drops.count(one.interface, Reason.IMPLAUSIBLE, one.pdu, detail=", ".join(one.rx.implausible))
        return True

    def confirm(self, confirm: Confirm, targets: tuple[Interface, ...] = ()) -> None:
        for listener in self._confirm_listeners:
            listener.confirm(confirm, targets)

    def links_changed(self) -> None:
        self._targets.clear()

    # Called by the endpoint for messages of users, and by interfaces for those of applications behind them.

    def request(
        self,
        kind: MessageType,
        pdu: bytes,
        where: str,
        asked: Parsed = NOTHING_ASKED,
        origin: Interface | None = None,
    ) -> None:
        """Send a PDU by the interfaces that the policy or the user chooses. Every outcome is reported as a confirm.

        where   socket that received the PDU, as place for the drop counters.
        asked   options of the message.
        origin  interface that received the PDU from an application. It and others at its broker do not send it.
        """
        self.requests = number = self.requests + 1
        now = self._clock()
        port, traffic_class = kind.btp_port, kind.traffic_class
        is_asked = asked is not NOTHING_ASKED
        if is_asked:
            options = asked.options
            port = port if options.btp_port is None else options.btp_port
            traffic_class = traffic_class if options.traffic_class is None else options.traffic_class
        if port is None:
            reason = Reason.NO_PORT if kind.name else Reason.UNKNOWN_TYPE
            self._refuse(self._not_made(kind, pdu, asked.options.label), reason, where)
            return
        row = self.policy.choose(kind, pdu, port, traffic_class, asked.area)
        lifetime, priority, traffic_class = row.plans[kind.row]
        # tuple.__new__ has the same result as Request() and takes half the time.
        request = _new(Request, (number, kind, pdu, port, now, now + lifetime, priority, traffic_class, None, 1, ""))
        targets = self._targets.get(row)
        if targets is None:
            targets = self._targets[row] = self._usable(row.interfaces, row.fallback)
        if origin is not None:
            targets = self._usable(row.interfaces, row.fallback, origin)
        if is_asked:
            request = _as_asked(request, asked)
            named = asked.options.interfaces
            if strange := [name for name in named or () if name != "*" and name not in self.interfaces]:
                detail = f"no interface {', '.join(map(repr, strange))}; one of {', '.join(self.interfaces)}"
                self._refuse(request, Reason.NO_INTERFACE, where, detail)
                return
            if named is not None:
                targets = self._usable(named, (), origin)
        if not targets or (row.rate is not None and not row.rate.allows(now)):
            named = row.interfaces if asked.options.interfaces is None else asked.options.interfaces
            reason = _why_not(targets, named)
            is_excluded = origin is not None and reason is Reason.NO_INTERFACE
            self._refuse(request, reason, where, f"it came from {origin.name}" if origin and is_excluded else "")
            return
        for stage in self.request_stages:
            passed = stage(request)
            if isinstance(passed, Reason):
                self._refuse(request, passed, where)
                return
            request = passed
        self.accepted += 1
        if self.is_confirm_wanted:
            self.confirm(Confirm(request, Outcome.ACCEPTED), targets)
        for interface in targets:
            interface.outlet.submit(request)

    def refuse_message(
        self,
        reason: Reason,
        sample: bytes,
        where: str,
        kind: MessageType | None = None,
        label: str = "",
        detail: str = "",
        invalid: Sequence[Fault] = (),
    ) -> None:
        """Count a message that is too invalid for a request, and confirm it as refused.

        sample   octets of the message, or of its invalid frame.
        where    socket that received the message, as place for the drop counters.
        invalid  faults of a message in JSON.
        """
        self.requests += 1
        self._refuse(self._not_made(kind or self._unknown, sample, label), reason, where, detail, invalid)

    # Called by the policy: firmware.routing.policy.Surroundings.

    def is_up(self, interface: str) -> bool:
        return interface in self.interfaces and self.interfaces[interface].is_up

    def has_up(self, ability: Can) -> bool:
        return any(
            interface.is_up and ability in interface.driver.capabilities.can for interface in self.interfaces.values()
        )

    def neighbours(self, interface: str, within_s: float, rssi_dbm: int | None, enough: int) -> int:
        if interface not in self.interfaces:
            return 0
        return self.interfaces[interface].neighbours.count(self._clock(), within_s, rssi_dbm, enough)

    def _not_made(self, kind: MessageType, pdu: bytes, label: str) -> Request:
        now = self._clock()
        return Request(self.requests, kind, pdu, 0, now, now, kind.priority, 0, label=label)

    def _refuse(
        self, request: Request, reason: Reason, where: str, detail: str = "", invalid: Sequence[Fault] = ()
    ) -> None:
        self._drops.count(where, reason, request.pdu, detail=detail)
        if self.is_confirm_wanted:
            self.confirm(Confirm(request, Outcome.REFUSED, "", reason, detail=detail, invalid=invalid))

    def _usable(
        self, names: Sequence[str], fallback: Sequence[str], origin: Interface | None = None
    ) -> tuple[Interface, ...]:
        """Return the interfaces for a request.

        Named interfaces with a link come first, then fall-back interfaces with a link. If no link is up, all named ones
        are returned: the request waits in their queues.

        origin  interface that the request came from: it and others at its broker are left out. Their MQTT clients would
                take each other's messages for new requests, without end.
        """
        named = self._transmitting(names, origin)
        up = tuple(interface for interface in named if interface.is_up)
        second = tuple(interface for interface in self._transmitting(fallback, origin) if interface.is_up)
        return up or second or named

    def _transmitting(self, names: Sequence[str], origin: Interface | None) -> tuple[Interface, ...]:
        interfaces = self.interfaces
        chosen = interfaces if "*" in names else dict.fromkeys(name for name in names if name in interfaces)
        able = (interfaces[name] for name in chosen if interfaces[name].can_transmit)
        return tuple(one for one in able if origin is None or not one.is_at_broker_of(origin))


class Routing(NamedTuple):
    """Router with the objects that it shares with the rest of the station."""

    loop: Loop
    topics: Topics
    drops: Drops
    router: Router


def _why_not(targets: tuple[Interface, ...], named: Sequence[str]) -> Reason:
    if targets:
        return Reason.RATE_LIMIT
    return Reason.NO_INTERFACE if named else Reason.POLICY


def _as_asked(request: Request, asked: Parsed) -> Request:
    """Return the request with the options of its user, which override the policy's values."""
    options = asked.options
    changes: dict[str, Any] = {"area": asked.area, "label": options.label}
    if asked.area is not None:
        changes["hop_limit"] = options.hop_limit or DEFAULT_HOP_LIMIT
    if options.lifetime_s is not None:
        changes["deadline"] = request.accepted + options.lifetime_s
    if options.priority is not None:
        changes["priority"] = options.priority
    if options.traffic_class is not None:
        changes["traffic_class"] = options.traffic_class
    if options.btp_port is not None:
        changes["btp_port"] = options.btp_port
    return request._replace(**changes)
