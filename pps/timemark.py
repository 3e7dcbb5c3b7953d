"""Pairing of pulses with their seconds, by a receiver's messages before and after each.

Three sources must agree, because a wrong second is worse than a missing one. TIM-TP announces the next pulse
(TimeMark). NAV-PVT describes the epoch that a pulse began (Fix). The raw clock counts whole seconds between good
pulses. The rules:

# state      event                                        -> state      what comes of it
#
# any        an edge                                         same       it waits WAIT_S for its messages
# any        WAIT_S is over                                  same       refused, with the reason
# any        WAIT_S was over a while ago: the loop stalled   same       it waits on: messages may be unread
#
# SEARCHING  an edge < 5 ms after another                    same       refused: a bounce
# SEARCHING  TIM-TP in the second before an edge, and        same       the first three in a row: refused
#            NAV-PVT soon after it, name one second          FOLLOWING  the fourth: passed on, a new series
# SEARCHING  the fourth, < 0.5 s after an edge of another    same       refused: perhaps a trailing edge
#            row
# SEARCHING  they do not, or break the row                   same       refused; the row begins anew
#
# FOLLOWING  an edge whole seconds after the last good one,  same       passed on
#            TIM-TP and NAV-PVT of the second that it is by
#            the raw clock, even if they come late
# FOLLOWING  two edges of one second                         same       the nearest to its place that is not early is
#                                                                       meant, the other is refused
# FOLLOWING  an edge between whole seconds                   same       refused
# FOLLOWING  TIM-TP or NAV-PVT name another second           same       refused
# FOLLOWING  the first edge FOLLOW_NS after the last good    RETURNING
#
# RETURNING  as SEARCHING, and the row is of the seconds     FOLLOWING  the fourth: passed on, the series goes on
#            that have come by the raw clock
# RETURNING  the row is of other seconds, or between them    same       refused
# RETURNING  it has been for RELABEL_S                       FOLLOWING  the receiver is right: a new series
# RETURNING  the first edge LIFE_NS after the last good      SEARCHING  drift leaves the second in doubt

PulsedTime (firmware/clock/pulsed_time.py) calls pulse(), mark() and fix() as they come, in any state, and expire() at
deadline(). Each returns the events that it caused.

Seconds are those of ITS time; only the comparison with UTC uses leap seconds. The order of delivery within a turn of
the loop does not matter, because every message carries its time.

Not detectable: a line, or a loop, that is late by whole seconds from the first message on. It makes TIM-TP and NAV-PVT
agree on a past second. Bring-up sets a baud rate at which no line is that late.
"""

from collections import Counter
from typing import NamedTuple

from board.time.scales import Fix, LeapEvent, TimeMark
from pps.chain import EDGE_NS, LIFE_NS, SECOND_NS, Chain
from pps.pulse import Pulse
from pps.refused import Refused, Why
from pps.statements import LIMIT_NS, Statements, is_of_utc

WAIT_S = 0.9  # longest wait of an edge for its messages; ends before those of the next second
PUNCTUAL_S = 0.05  # a timer that is later than this shows that the loop stalled and messages are still unread
GRACE_S = 0.5  # additional wait after a stall; messages are read by then

AGREEING = 4  # seconds that make a row; gpsd requires as many
GAP_NS = 5 * SECOND_NS  # longest gap of missing edges within a row
ROWS = 8  # most other rows at a time, because noise forms rows too
# A receiver that returned with a wrong second knows the right one by then. GPS transmits the almanac, and with it the
# leap seconds, once in 12.5 minutes.
RELABEL_S = 780

# After this time, the grid is known only to 10 ms, and a stray edge could pass for the pulse. So a row is searched
# again.
FOLLOW_NS = 60 * SECOND_NS

TRAILING_NS = SECOND_NS // 2  # longest pulse that is expected; the driver configures 100 ms
RIVAL = 2  # seconds after which a competing row of edges may be the one of the leading edges
WAITING = 64  # most edges that wait


class Second(NamedTuple):
    """Pulse with the confirmed second that it begins.

    its_s         ITS time.
    accuracy_ns   accuracy of the receiver's time, as it reports.
    leap_seconds  GPS time minus UTC, s, as the receiver reports.
    leap_event    leap second announced by satellites.
    series        number of the acquisition. Within one series, its_s counts the seconds of raw_ns; a new series may
                  have other seconds.
    """

    pulse: Pulse
    its_s: int
    accuracy_ns: int
    leap_seconds: int | None
    leap_event: LeapEvent | None
    series: int = 1


class Acquired(NamedTuple):
    """Begin of a new series.

    its_s     second of its first pulse.
    series    its number.
    change_s  its seconds minus the previously counted ones; None if none were counted.
    """

    its_s: int
    series: int
    change_s: int | None


Event = Second | Refused | Acquired


class _Edge:
    """Pulse that waits. its_s: its second by the chain; None without a chain, or between seconds."""

    __slots__ = ("due", "error_ns", "is_graced", "its_s", "pulse")

    def __init__(self, pulse: Pulse) -> None:
        self.pulse = pulse
        self.due = pulse.monotonic + WAIT_S
        self.is_graced = False
        self.its_s: int | None = None
        self.error_ns = 0


class Pairing:
    """Pairs the pulses of one receiver with seconds. Each input returns the events that it causes, in order.

    limit_ns  accuracy of time that the receiver must report at least.
    refused   number of refused pulses, by reason.
    samples   last refused pulse, by reason.
    """

    def __init__(self, limit_ns: int = LIMIT_NS) -> None:
        self.refused: Counter[Why] = Counter()
        self.samples: dict[Why, Refused] = {}
        self._statements = Statements(limit_ns)
        self._chain: Chain | None = None  # chain of the edges that were passed on as seconds
        self._is_following = False
        self._rows: list[Chain] = []  # candidate rows while no chain is followed
        self._edges: list[_Edge] = []
        self._edge_ns: int | None = None  # raw clock of the last edge, good or not
        self._series = 0

    def pulse(self, pulse: Pulse) -> list[Event]:
        """Add an edge, in the order of sequence."""
        raw_ns, before_ns = pulse.raw_ns, self._edge_ns
        self._edge_ns = raw_ns
        self._age(raw_ns)
        edge = _Edge(pulse)
        if (chain := self._followed) is not None:
            _place(edge, chain)
            if _is_taken(edge, chain):
                return [self._refuse(edge, Why.DUPLICATE, f"second {edge.its_s}, {edge.error_ns} ns from it")]
        elif before_ns is not None and abs(raw_ns - before_ns) < EDGE_NS:
            return [self._refuse(edge, Why.TRAILING, f"{(raw_ns - before_ns) / 1e6:.3f} ms after another")]
        self._edges.append(edge)
        found = self._given_up(self._edges[0]) if len(self._edges) > WAITING else []
        return found + self._settle()

    def mark(self, mark: TimeMark) -> list[Event]:
        """Add an announcement."""
        self._statements.mark(mark)
        return self._settle() if self._edges else []

    def fix(self, fix: Fix) -> list[Event]:
        """Add an epoch."""
        return self._settle() if self._statements.fix(fix) and self._edges else []

    def deadline(self) -> float | None:
        """Return when to call expire(); None if no edge waits."""
        return min(edge.due for edge in self._edges) if self._edges else None

    def expire(self, now: float) -> list[Event]:
        """Refuse edges that have waited too long."""
        found: list[Event] = []
        for edge in [edge for edge in self._edges if edge.due <= now]:
            if now - edge.due > PUNCTUAL_S and not edge.is_graced:
                edge.due, edge.is_graced = now + GRACE_S, True
            else:
                found += self._given_up(edge)
        return found

    def _age(self, raw_ns: int) -> None:
        """Stop following, or forget, a chain that is too old for this edge."""
        chain = self._chain
        if chain is None or not chain.is_over(raw_ns, FOLLOW_NS):
            return
        self._is_following = False
        if chain.is_over(raw_ns, LIFE_NS):
            self._chain = None

    def _settle(self) -> list[Event]:
        """Pass on edges that are confirmed by now."""
        found: list[Event] = []
        for edge in list(self._edges):
            if (chain := self._followed) is None:
                found += self._search(edge)
            elif edge.its_s is not None and not _is_taken(edge, chain):
                found += self._follow(edge, edge.its_s, chain)
        return found

    # FOLLOWING

    @property
    def _followed(self) -> Chain | None:
        """Chain that places edges; None while SEARCHING or RETURNING, even if an old chain is kept."""
        return self._chain if self._is_following else None

    def _follow(self, edge: _Edge, its_s: int, chain: Chain) -> list[Event]:
        epoch = self._statements.confirmed(edge.pulse, its_s)
        mark = None if epoch is None else self._statements.announced(edge.pulse, its_s)
        if epoch is None or mark is None or not is_of_utc(epoch, its_s, mark):
            return []
        found: list[Event] = []
        if len(self._edges) > 1:
            edge, *others = self._by_merit(its_s, chain)
            found = [
                self._refuse(
                    one, Why.DUPLICATE, f"{one.error_ns} ns from second {its_s}, a better edge {edge.error_ns} ns"
                )
                for one in others
            ]
            self._edges = [one for one in self._edges if one.its_s != its_s]
        else:
            self._edges.clear()
        chain.extend(edge.pulse.raw_ns, its_s, edge.error_ns)
        for other in self._edges:
            _place(other, chain)
        return [self._second(its_s, edge.pulse, mark, epoch.fix), *found]

    def _by_merit(self, its_s: int, chain: Chain) -> list[_Edge]:
        """Sort the edges of one second: those not early, nearest to the expected time first; then the least early."""
        edges = [edge for edge in self._edges if edge.its_s == its_s]
        if len(edges) == 1:
            return edges
        expected_ns, within_ns = chain.expected(its_s)

        def demerit(edge: _Edge) -> tuple[bool, float]:
            late_ns = edge.pulse.raw_ns - expected_ns
            return late_ns < -within_ns, abs(late_ns)

        return sorted(edges, key=demerit)

    def _second(self, its_s: int, pulse: Pulse, mark: TimeMark, fix: Fix) -> Second:
        assert fix.utc_accuracy_ns is not None
        accuracy_ns = max(mark.accuracy_ns, fix.utc_accuracy_ns)
        return Second(pulse, its_s, accuracy_ns, mark.leap_seconds, mark.leap_event, self._series)

    # SEARCHING and RETURNING

    def _search(self, edge: _Edge) -> list[Event]:
        claim = self._statements.claim(edge.pulse)
        if claim is None:
            return []
        self._edges.remove(edge)
        its_s, mark, fix = claim
        row = self._row(edge.pulse.raw_ns, its_s)
        if row.count < AGREEING:
            return [self._refuse(edge, Why.ACQUIRING, f"second {its_s}, {row.count} of {AGREEING}")]
        if self._has_rival(edge.pulse.raw_ns):
            return [self._refuse(edge, Why.TRAILING, f"second {its_s}, but edges before these also fit")]
        place = None if self._chain is None else self._chain.place(edge.pulse.raw_ns)
        is_known = place is not None and place.is_whole and place.its_s == its_s
        if place is None or is_known or row.raw_ns - row.since_ns >= RELABEL_S * SECOND_NS:
            change_s = None if place is None else its_s - place.its_s
            return [
                *self._acquire(row, None if is_known else Acquired(its_s, self._series + 1, change_s)),
                self._second(its_s, edge.pulse, mark, fix),
            ]
        detail = f"second {its_s} by the receiver, {place.its_s} and {place.error_ns} ns by the count"
        return [self._refuse(edge, Why.OTHER_SECOND, detail)]

    def _row(self, raw_ns: int, its_s: int) -> Chain:
        """Return the row of a claim, extended; a row of the same edges with other seconds ends."""
        rows = [row for row in self._rows if not row.is_over(raw_ns, GAP_NS)]
        found: Chain | None = None
        for row in rows:
            place = row.place(raw_ns)
            if place.is_whole and place.its_s > row.its_s:
                rows.remove(row)
                if place.its_s == its_s:
                    row.extend(raw_ns, its_s, place.error_ns)
                    found = row
                break
        found = found or Chain(raw_ns, its_s)
        self._rows = [*rows[-ROWS:], found]
        return found

    def _has_rival(self, raw_ns: int) -> bool:
        """Return whether an edge may be the end of a pulse whose beginning belongs to another row."""
        return any(row.count >= RIVAL and EDGE_NS < raw_ns - row.raw_ns < TRAILING_NS for row in self._rows)

    def _acquire(self, row: Chain, acquired: Acquired | None) -> list[Event]:
        """Follow a row from now on."""
        self._chain, self._is_following, self._rows = row, True, []
        for other in self._edges:
            _place(other, row)
        if acquired is None:
            return []
        self._series = acquired.series
        return [acquired]

    # Refusals

    def _given_up(self, edge: _Edge) -> list[Event]:
        """Refuse an edge that was not confirmed in time."""
        self._edges.remove(edge)
        raw_ns = edge.pulse.raw_ns
        chain = self._followed
        if chain is None:
            why, detail = self._statements.why(edge.pulse, None)
            if why in (Why.DISAGREE, Why.UTC):
                self._rows = [row for row in self._rows if not row.place(raw_ns).is_whole]
            return [self._refuse(edge, why, detail)]
        if edge.its_s is None:
            place = chain.place(raw_ns)
            return [self._refuse(edge, Why.OFF_GRID, f"{place.error_ns} ns off second {place.its_s}")]
        return [self._refuse(edge, *self._statements.why(edge.pulse, edge.its_s))]

    def _refuse(self, edge: _Edge, why: Why, detail: str) -> Refused:
        refused = Refused(why, edge.pulse, detail)
        self.refused[why] += 1
        self.samples[why] = refused
        return refused


def _place(edge: _Edge, chain: Chain) -> None:
    """Find the second of an edge by a chain."""
    place = chain.place(edge.pulse.raw_ns)
    edge.its_s = place.its_s if place.is_whole else None
    edge.error_ns = place.error_ns


def _is_taken(edge: _Edge, chain: Chain) -> bool:
    """Return whether the edge's second, or a later one, was passed on already."""
    return edge.its_s is not None and edge.its_s <= chain.its_s
