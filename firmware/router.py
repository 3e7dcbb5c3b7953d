"""The way of a message: from an interface through the stages to the users, from a user through the policy out."""

import math
from collections.abc import Callable, Sequence
from typing import Any

from board.loop import Loop
from board.time import TimeQuality
from drivers.contract import Can
from drivers.message import UNKNOWN_TIME, Confirm, Ego, Indication, MessageType, Outcome, Request
from drivers.reason import Reason
from firmware.drops import Drops
from firmware.interface import Interface
from firmware.options import NOTHING_ASKED, Parsed
from firmware.policy import Policy, Row
from firmware.topics import Topics

_new = tuple.__new__
DEFAULT_HOP_LIMIT = 10  # itsGnDefaultHopLimit, EN 302 636-4-1 V1.4.1 Annex H
BURST = 32  # indications that wait at most, 0.2 ms or so of a flood
Stage = Callable[[list[Indication]], list[Indication]]
RequestStage = Callable[[Request], Request | Reason]


class Router:
    """Routes indications to users and requests to interfaces.

    publish         gives indications to the users; one that they cannot take is its business.
    report          gives a confirm to those who listen.
    observe         shows indications as they come, before any stage; None while nobody looks.
    quality         of the time, of this second; indications have it. After quality_until, for the loop may be late, it
                    has to be renewed before: renew_quality does so.
    ego             own time and position.
    stages          what indications pass on their way; each returns what goes on, having said why the rest does not.
    request_stages  what a request passes after the policy; each returns what goes on, or the reason against it.

    What one turn of the loop brings goes up together: a stage is called once for all of it, and the I/O thread of
    libzmq is woken once.
    """

    def __init__(self, loop: Loop, topics: Topics, drops: Drops, ego: Callable[[], Ego]) -> None:
        self.is_confirm_wanted = False
        self.interfaces: dict[str, Interface] = {}
        self.stages: Sequence[Stage] = ()
        self.request_stages: Sequence[RequestStage] = ()
        self.publish: Callable[[list[Indication]], None] = lambda indications: None
        self.report: Callable[[Confirm, tuple[Interface, ...]], None] = lambda confirm, targets: None
        self.observe: Callable[[list[Indication]], None] | None = None
        self.quality: TimeQuality = UNKNOWN_TIME
        self.quality_until = math.inf
        self.renew_quality: Callable[[], None] = lambda: None
        self.ego = ego
        self.policy = Policy((), topics, self)
        self.requests = 0
        self.accepted = 0
        self._loop = loop
        self._clock = loop.clock
        self._burst: list[Indication] = []
        self._unknown = topics.unknown
        self._drops = drops
        self._targets: dict[Row, tuple[Interface, ...]] = {}

    def add(self, interface: Interface) -> None:
        self.interfaces[interface.name] = interface
        self._targets.clear()

    def set_policy(self, policy: Policy) -> None:
        """Exchange the policy between two messages; queues and connections stay."""
        counts = {row.name: row.matched for row in self.policy.rows}
        for row in policy.rows:
            row.matched = counts.get(row.name, 0)
        self.policy = policy
        self._targets.clear()

    # From an interface: firmware.interface.Above.

    def indicate(self, indication: Indication) -> None:
        """Take an indication; it goes up at the end of the turn."""
        burst = self._burst
        if not burst:
            self._loop.soon(self.flush)
        burst.append(indication)
        if len(burst) >= BURST:
            self.flush()

    def renewed_quality(self) -> TimeQuality:
        self.renew_quality()
        return self.quality

    def quality_now(self) -> TimeQuality:
        return self.quality if self._clock() < self.quality_until else self.renewed_quality()

    def flush(self) -> None:
        """Let what has come so far go up."""
        burst = self._burst
        if burst:
            self._burst = []
            if self.observe is not None:
                self.observe(burst)
            if self.policy.received:
                burst = [one for one in burst if not (one.rx.implausible and self._is_refused(one))]
            for stage in self.stages:
                burst = stage(burst)
            self.publish(burst)

    def _is_refused(self, one: Indication) -> bool:
        """Drop an implausible message where the policy says so; before any stage: it must not hide a plausible one."""
        if not self.policy.refuses(one):
            return False
        self._drops.count(one.interface, Reason.IMPLAUSIBLE, one.pdu, detail=", ".join(one.rx.implausible))
        return True

    def confirm(self, confirm: Confirm) -> None:
        self.report(confirm, ())

    def links_changed(self) -> None:
        self._targets.clear()

    # From a user.

    def request(self, kind: MessageType, pdu: bytes, where: str, asked: Parsed = NOTHING_ASKED) -> None:
        """Send a PDU by the interfaces that the policy names; every way out of here is a confirm.

        where  the socket that it came by, for the counters.
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
        # tuple.__new__ is what Request() comes to, at half the price.
        request = _new(Request, (number, kind, pdu, port, now, now + lifetime, priority, traffic_class, None, 1, ""))
        targets = self._targets.get(row)
        if targets is None:
            targets = self._targets[row] = self._usable(row.interfaces, row.fallback)
        if is_asked:
            request = _as_asked(request, asked)
            named = asked.options.interfaces
            if strange := [name for name in named or () if name != "*" and name not in self.interfaces]:
                detail = f"no interface {', '.join(map(repr, strange))}; one of {', '.join(self.interfaces)}"
                self._refuse(request, Reason.NO_INTERFACE, where, detail)
                return
            if named is not None:
                targets = self._usable(named, ())
        if not targets or (row.rate is not None and not row.rate.allows(now)):
            named = row.interfaces if asked.options.interfaces is None else asked.options.interfaces
            self._refuse(request, _why_not(targets, named), where)
            return
        for stage in self.request_stages:
            passed = stage(request)
            if isinstance(passed, Reason):
                self._refuse(request, passed, where)
                return
            request = passed
        self.accepted += 1
        if self.is_confirm_wanted:
            self.report(Confirm(request, Outcome.ACCEPTED), targets)
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
    ) -> None:
        """Count a message that no request can be made of, and tell its user."""
        self.requests += 1
        self._refuse(self._not_made(kind or self._unknown, sample, label), reason, where, detail)

    # What the policy asks: firmware.policy.Surroundings.

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

    def _refuse(self, request: Request, reason: Reason, where: str, detail: str = "") -> None:
        self._drops.count(where, reason, request.pdu, detail=detail)
        if self.is_confirm_wanted:
            self.report(Confirm(request, Outcome.REFUSED, "", reason, detail=detail), ())

    def _usable(self, names: Sequence[str], fallback: Sequence[str]) -> tuple[Interface, ...]:
        """Those of the named interfaces whose link is up; else the fall-back's; else all named, to wait there."""
        named = self._transmitting(names)
        up = tuple(interface for interface in named if interface.is_up)
        second = tuple(interface for interface in self._transmitting(fallback) if interface.is_up)
        return up or second or named

    def _transmitting(self, names: Sequence[str]) -> tuple[Interface, ...]:
        interfaces = self.interfaces
        chosen = interfaces if "*" in names else dict.fromkeys(name for name in names if name in interfaces)
        return tuple(interfaces[name] for name in chosen if interfaces[name].can_transmit)


def _why_not(targets: tuple[Interface, ...], named: Sequence[str]) -> Reason:
    if targets:
        return Reason.RATE_LIMIT
    return Reason.NO_INTERFACE if named else Reason.POLICY


def _as_asked(request: Request, asked: Parsed) -> Request:
    """What its user asks goes before what the policy says."""
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
