"""Policy: rows of captain.toml, compiled into tests of a message."""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol, TypeAlias

from drivers.contract import Can
from drivers.message import Area, Ego, Indication, MessageType, Position, Shape
from drivers.wire.area import contains
from firmware.config.tables import Match, NeighbourMatch, PayloadMatch, PolicyRow, PositionMatch, Span
from firmware.topics import Topics


class Candidate(NamedTuple):
    """Message that the rows of the policy are compared with, before it becomes a request."""

    kind: MessageType
    pdu: bytes
    btp_port: int
    traffic_class: int
    area: Area | None


class Surroundings(Protocol):
    """Current state of the station that rows may test: interfaces, neighbours, position."""

    def is_up(self, interface: str) -> bool: ...
    def has_up(self, ability: Can) -> bool: ...
    def neighbours(self, interface: str, within_s: float, rssi_dbm: int | None, enough: int) -> int: ...
    def ego(self) -> Ego: ...


Test = Callable[[Candidate], bool]


class Rate:
    """Token bucket that limits messages per second. It holds the tokens of one second, and at least one."""

    def __init__(self, per_s: float) -> None:
        self.per_s = per_s
        self._tokens = max(1.0, per_s)
        self._then = -math.inf

    def allows(self, now: float) -> bool:
        elapsed = now - self._then
        self._then = now
        self._tokens = min(max(1.0, self.per_s), self._tokens + elapsed * self.per_s)
        if self._tokens < 1.0:
            return False
        self._tokens -= 1.0
        return True


# lifetime_s, priority and traffic_class of a row; None: the type's.
Values: TypeAlias = tuple[float | None, int | None, int | None]


class Plan(NamedTuple):
    """Lifetime in seconds, priority and traffic class of a type's messages by a row; options of a message override."""

    lifetime: float
    priority: int
    traffic_class: int


class CompiledRow:
    """Row of the policy with its match compiled into tests, and a Plan for each message type."""

    def __init__(self, row: PolicyRow, name: str, plans: Sequence[Plan], surroundings: Surroundings) -> None:
        self.name = name
        self.interfaces = row.interfaces
        self.fallback = row.fallback
        self.types = frozenset(row.match.type)
        self.doubts = frozenset(row.match.implausible)
        self.matched = 0
        self.tests = tuple(_tests(row.match, surroundings))
        self.rate = Rate(row.rate_per_s) if row.rate_per_s else None
        self.plans = plans


class Policy:
    """Rows of the policy in order. The last row is built in: it sends every message by every interface.

    received  rows that apply to implausible received messages instead of requests.

    It raises no errors, because the configuration was checked when it was read.
    """

    def __init__(self, rows: Sequence[PolicyRow], topics: Topics, surroundings: Surroundings) -> None:
        self._topics = topics
        self._surroundings = surroundings
        self._plans: dict[Values, list[Plan]] = {}  # plans by the row's values, shared by rows
        last = self._made(PolicyRow(), "default")
        self.rows = [last]
        self.received: list[CompiledRow] = []
        self._by_kind = [[last] for _ in topics.kinds]
        self.extend(rows)

    def extend(self, rows: Sequence[PolicyRow]) -> None:
        """Insert further rows before the built-in last row."""
        for row in rows:
            made = self._made(row, row.name or f"policy[{len(self.rows) - 1}]")
            self.rows.insert(-1, made)
            if made.doubts:
                self.received.append(made)
                continue
            for kind, of_kind in zip(self._topics.kinds, self._by_kind, strict=True):
                if not made.types or kind.name in made.types:
                    of_kind.insert(-1, made)

    def add_kind(self, kind: MessageType) -> None:
        """Take a type that was added to the table of types."""
        for values, plans in self._plans.items():
            plans.append(_plan(values, kind))
        self._by_kind.append([row for row in self.rows if not row.doubts and (not row.types or kind.name in row.types)])

    def choose(
        self, kind: MessageType, pdu: bytes, btp_port: int, traffic_class: int, area: Area | None
    ) -> CompiledRow:
        """Return the first row of which all tests pass for a message, and count the match."""
        rows = self._by_kind[kind.row]
        row = rows[0]
        if row.tests:
            candidate = Candidate(kind, pdu, btp_port, traffic_class, area)
            for row in rows:  # plain loops: with 10,000 rows they take 2 ms; all() with a generator takes 11 ms
                for test in row.tests:
                    if not test(candidate):
                        break
                else:
                    break
        row.matched += 1
        return row

    def refuses(self, one: Indication) -> bool:
        """Return True if the policy drops an implausible message: the first row that applies has no interfaces."""
        rx = one.rx
        candidate = Candidate(one.kind, one.pdu, rx.btp_port or 0, rx.traffic_class, rx.area)
        for row in self.received:
            is_of_row = "any" in row.doubts or not row.doubts.isdisjoint(rx.implausible)
            is_of_type = not row.types or one.kind.name in row.types
            if is_of_row and is_of_type and all(test(candidate) for test in row.tests):
                row.matched += 1
                return not row.interfaces
        return False

    def status(self) -> list[dict[str, object]]:
        """Return an object for each row of the policy.

        name     name of the row.
        matched  number of messages that the row was applied to.
        """
        return [{"name": row.name, "matched": row.matched} for row in self.rows]

    def _made(self, row: PolicyRow, name: str) -> CompiledRow:
        key = row.lifetime_s, row.priority, row.traffic_class
        if key not in self._plans:
            self._plans[key] = [_plan(key, kind) for kind in self._topics.kinds]
        return CompiledRow(row, name, self._plans[key], self._surroundings)


def _plan(asked: Values, kind: MessageType) -> Plan:
    lifetime_s, priority, traffic_class = asked
    return Plan(
        kind.lifetime if lifetime_s is None else lifetime_s,
        kind.priority if priority is None else priority,
        kind.traffic_class if traffic_class is None else traffic_class,
    )


def _tests(match: Match, surroundings: Surroundings) -> list[Test]:
    """Return the tests of a match, cheapest first."""
    tests: list[Test] = []
    if match.station:
        stations = frozenset(station.to_bytes(4, "big") for station in match.station)
        tests.append(lambda candidate: candidate.pdu[2:6] in stations)
    if match.size != Span():
        tests.append(_size(match.size))
    if match.btp_port:
        tests.append(lambda candidate: candidate.btp_port in match.btp_port)
    if match.traffic_class:
        tests.append(lambda candidate: candidate.traffic_class in match.traffic_class)
    tests += [_payload(payload) for payload in match.payload]
    tests += [_link(name, surroundings, is_up=True) for name in match.link_up]
    tests += [_link(name, surroundings, is_up=False) for name in match.link_down]
    if match.bearer is not None:
        tests.append(lambda _: surroundings.has_up(Can.BEARER) is match.bearer)
    if match.neighbours:
        tests.append(_neighbours(match.neighbours, surroundings, are_wanted=True))
    if match.no_neighbours:
        tests.append(_neighbours(match.no_neighbours, surroundings, are_wanted=False))
    if match.position:
        tests.append(_position(match.position, surroundings))
    if match.area:
        tests.append(_area(match.area, surroundings))
    return tests


def _size(span: Span) -> Test:
    least = 0 if span.min is None else span.min
    most = math.inf if span.max is None else span.max
    return lambda candidate: least <= len(candidate.pdu) <= most


def _payload(payload: PayloadMatch) -> Test:
    value = bytes.fromhex(payload.value)
    mask = int.from_bytes(bytes.fromhex(payload.mask) or b"\xff" * len(value), "big")
    wanted = int.from_bytes(value, "big") & mask
    start, end = payload.offset, payload.offset + len(value)
    return lambda candidate: (
        len(candidate.pdu) >= end and int.from_bytes(candidate.pdu[start:end], "big") & mask == wanted
    )


def _link(name: str, surroundings: Surroundings, is_up: bool) -> Test:
    return lambda _: surroundings.is_up(name) is is_up


def _neighbours(match: NeighbourMatch, surroundings: Surroundings, are_wanted: bool) -> Test:
    def test(_: Candidate) -> bool:
        heard = surroundings.neighbours(match.interface, match.within_s, match.rssi_dbm, match.count)
        return (heard >= match.count) is are_wanted

    return test


def _position(match: PositionMatch, surroundings: Surroundings) -> Test:
    circle = Area(
        Shape.CIRCLE,
        Position(round(match.latitude * 1e7), round(match.longitude * 1e7)),
        round(match.radius_m),
    )

    def test(_: Candidate) -> bool:
        ego = surroundings.ego()
        return ego.is_known and contains(circle, ego.position)

    return test


def _area(wanted: str, surroundings: Surroundings) -> Test:
    if wanted in ("none", "any"):
        return lambda candidate: (candidate.area is None) is (wanted == "none")

    def test(candidate: Candidate) -> bool:
        ego = surroundings.ego()
        if candidate.area is None or not ego.is_known:
            return False
        return contains(candidate.area, ego.position) is (wanted == "inside")

    return test
