"""Which second each pulse begins: pulses, what a receiver says before and after them, and what has gone by.

Three witnesses: TIM-TP announces the pulse that comes next (TimeMark), NAV-PVT is of the epoch that a pulse began
(Fix), and the raw clock counts whole seconds from one good pulse to the next. A second that is wrong is worse than
none, so all have to agree. The rules:

# state      event                                        -> state      what comes of it
#
# any        an edge                                         same       it waits for what is said of it: WAIT_S
# any        WAIT_S is over                                  same       refused, with the reason
# any        WAIT_S was over a while ago: the loop stalled   same       it waits on: that may be there, unread
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
# RETURNING  it has been for RELABEL_S                       FOLLOWING  the receiver is believed: a new series
# RETURNING  the first edge LIFE_NS after the last good      SEARCHING  the oscillator cannot tell seconds any more

Nothing here knows leap seconds but the comparison of UTC: the seconds are those of ITS time. Nothing depends on the
order in which a turn of the loop delivers what it has, for every word carries its time.

What cannot be told: a line, or a loop, that is late by whole seconds from the first word on, steadily. It makes TIM-TP
and NAV-PVT agree on a second that is past. Bring-up sets a rate at which no line is.
"""

from collections import Counter
from typing import NamedTuple

from board.time import Fix, LeapEvent, TimeMark
from pps.chain import EDGE_NS, LIFE_NS, SECOND_NS, Chain
from pps.pulse import Pulse
from pps.refused import Refused, Why
from pps.statements import LIMIT_NS, Statements, is_of_utc

WAIT_S = 0.9  # from an edge to the words that make it good: before those of the next second
PUNCTUAL_S = 0.05  # a timer that is later than this: the loop stalled, and has not read what came meanwhile
GRACE_S = 0.5  # it has, by then

AGREEING = 4  # seconds that make a row; gpsd asks for as many
GAP_NS = 5 * SECOND_NS  # a row may miss edges, and still be a row
ROWS = 8  # others at a time: noise makes some as well
# A receiver that came back with a wrong second has been told by satellites by then: the almanac of GPS, and with it the
# leap seconds, comes once in 12.5 minutes.
RELABEL_S = 780

# So much later the grid is known to 10 ms, and a stray edge could pass for the pulse: its place is sought anew.
FOLLOW_NS = 60 * SECOND_NS

TRAILING_NS = SECOND_NS // 2  # pulses are shorter than that: the driver sets 100 ms
RIVAL = 2  # seconds of a row that may be of the leading edges
WAITING = 64  # edges at a time


class Second(NamedTuple):
    """A pulse and the second that it begins, beyond doubt.

    its_s         ITS time.
    accuracy_ns   of the receiver's time, as it says itself.
    leap_seconds  GPS time less UTC, s, as the receiver says. leap_event: announced by satellites.
    series        number of the acquisition that it counts from: in one series its_s counts the seconds of raw_ns; a
                  new one may say another second.
    """

    pulse: Pulse
    its_s: int
    accuracy_ns: int
    leap_seconds: int | None
    leap_event: LeapEvent | None
    series: int = 1


class Acquired(NamedTuple):
    """A new series begins.

    its_s     of its first pulse. series: its number.
    change_s  by how much its seconds are ahead of those that were counted; None where none were.
    """

    its_s: int
    series: int
    change_s: int | None


Event = Second | Refused | Acquired


class _Edge:
    """A pulse that waits. its_s: its second by the chain; None: there is none, or it stands between seconds."""

    __slots__ = ("due", "error_ns", "is_graced", "its_s", "pulse")

    def __init__(self, pulse: Pulse) -> None:
        self.pulse = pulse
        self.due = pulse.monotonic + WAIT_S
        self.is_graced = False
        self.its_s: int | None = None
        self.error_ns = 0


class Pairing:
    """One receiver and the pulses that it drives. All that goes in returns what is known by it, in order.

    limit_ns  what accuracy the receiver must claim for its time.
    refused   how often, by reason. samples: the last of each.
    """

    def __init__(self, limit_ns: int = LIMIT_NS) -> None:
        self.refused: Counter[Why] = Counter()
        self.samples: dict[Why, Refused] = {}
        self._statements = Statements(limit_ns)
        self._chain: Chain | None = None  # of the seconds passed on
        self._is_following = False
        self._rows: list[Chain] = []  # what the receiver has said in a row while nothing is followed
        self._edges: list[_Edge] = []
        self._edge_ns: int | None = None  # the last edge of any kind
        self._series = 0

    def pulse(self, pulse: Pulse) -> list[Event]:
        """An edge, in the order of their sequence."""
        raw_ns, before_ns = pulse.raw_ns, self._edge_ns
        self._edge_ns = raw_ns
        self._age(raw_ns)
        edge = _Edge(pulse)
        if self._is_following:
            self._place(edge)
            if self._is_taken(edge):
                return [self._refuse(edge, Why.DUPLICATE, f"second {edge.its_s}, {edge.error_ns} ns off it")]
        elif before_ns is not None and abs(raw_ns - before_ns) < EDGE_NS:
            return [self._refuse(edge, Why.TRAILING, f"{(raw_ns - before_ns) / 1e6:.3f} ms after another")]
        self._edges.append(edge)
        found = self._given_up(self._edges[0]) if len(self._edges) > WAITING else []
        return found + self._settle()

    def mark(self, mark: TimeMark) -> list[Event]:
        """An announcement."""
        self._statements.mark(mark)
        return self._settle() if self._edges else []

    def fix(self, fix: Fix) -> list[Event]:
        """An epoch."""
        return self._settle() if self._statements.fix(fix) and self._edges else []

    def deadline(self) -> float | None:
        """When expire() has something to do; None: not before something else has come."""
        return min(edge.due for edge in self._edges) if self._edges else None

    def expire(self, now: float) -> list[Event]:
        """Refuse what has waited for too long."""
        found: list[Event] = []
        for edge in [edge for edge in self._edges if edge.due <= now]:
            if now - edge.due > PUNCTUAL_S and not edge.is_graced:
                edge.due, edge.is_graced = now + GRACE_S, True
            else:
                found += self._given_up(edge)
        return found

    def _age(self, raw_ns: int) -> None:
        """Forget what an oscillator cannot keep until an edge."""
        chain = self._chain
        if chain is None or not chain.is_over(raw_ns, FOLLOW_NS):
            return
        self._is_following = False
        if chain.is_over(raw_ns, LIFE_NS):
            self._chain = None

    def _settle(self) -> list[Event]:
        """Pass on what has become good."""
        found: list[Event] = []
        for edge in list(self._edges):
            if not self._is_following:
                found += self._search(edge)
            elif edge.its_s is not None and not self._is_taken(edge):
                found += self._follow(edge, edge.its_s)
        return found

    # FOLLOWING

    def _place(self, edge: _Edge) -> None:
        """Find the second of an edge by the chain."""
        assert self._chain is not None
        place = self._chain.place(edge.pulse.raw_ns)
        edge.its_s = place.its_s if place.is_whole else None
        edge.error_ns = place.error_ns

    def _is_taken(self, edge: _Edge) -> bool:
        """Whether its second, or a later one, was passed on."""
        assert self._chain is not None
        return edge.its_s is not None and edge.its_s <= self._chain.its_s

    def _follow(self, edge: _Edge, its_s: int) -> list[Event]:
        epoch = self._statements.confirmed(edge.pulse, its_s)
        mark = None if epoch is None else self._statements.announced(edge.pulse, its_s)
        if epoch is None or mark is None or not is_of_utc(epoch, its_s, mark):
            return []
        assert self._chain is not None
        found: list[Event] = []
        if len(self._edges) > 1:
            edge, *others = self._by_merit(its_s)
            found = [
                self._refuse(one, Why.DUPLICATE, f"{one.error_ns} ns off second {its_s}, another {edge.error_ns} ns")
                for one in others
            ]
            self._edges = [one for one in self._edges if one.its_s != its_s]
        else:
            self._edges.clear()
        self._chain.extend(edge.pulse.raw_ns, its_s, edge.error_ns)
        for other in self._edges:
            self._place(other)
        return [self._second(its_s, edge.pulse, mark, epoch.fix), *found]

    def _by_merit(self, its_s: int) -> list[_Edge]:
        """The edges of one second: those that are not early, the nearest to its place first; else the least early."""
        assert self._chain is not None
        edges = [edge for edge in self._edges if edge.its_s == its_s]
        if len(edges) == 1:
            return edges
        expected_ns, within_ns = self._chain.expected(its_s)

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
            return [self._refuse(edge, Why.TRAILING, f"second {its_s}, and edges before it make a row as well")]
        place = None if self._chain is None else self._chain.place(edge.pulse.raw_ns)
        is_known = place is not None and place.is_whole and place.its_s == its_s
        if place is None or is_known or row.raw_ns - row.since_ns >= RELABEL_S * SECOND_NS:
            change_s = None if place is None else its_s - place.its_s
            return [
                *self._acquire(row, None if is_known else Acquired(its_s, self._series + 1, change_s)),
                self._second(its_s, edge.pulse, mark, fix),
            ]
        detail = f"second {its_s}; {place.its_s} has come, and {place.error_ns} ns"
        return [self._refuse(edge, Why.OTHER_SECOND, detail)]

    def _row(self, raw_ns: int, its_s: int) -> Chain:
        """The row that a claim belongs to; one at the same edges that counts otherwise ends with it."""
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
        """Whether an edge may be the end of a pulse that another row knows the beginning of."""
        return any(row.count >= RIVAL and EDGE_NS < raw_ns - row.raw_ns < TRAILING_NS for row in self._rows)

    def _acquire(self, row: Chain, acquired: Acquired | None) -> list[Event]:
        """Count from a row on."""
        self._chain, self._is_following, self._rows = row, True, []
        for other in self._edges:
            self._place(other)
        if acquired is None:
            return []
        self._series = acquired.series
        return [acquired]

    # What is no good

    def _given_up(self, edge: _Edge) -> list[Event]:
        """Refuse an edge that has waited for long enough."""
        self._edges.remove(edge)
        raw_ns = edge.pulse.raw_ns
        if not self._is_following:
            why, detail = self._statements.why(edge.pulse, None)
            if why in (Why.DISAGREE, Why.UTC):
                self._rows = [row for row in self._rows if not row.place(raw_ns).is_whole]
            return [self._refuse(edge, why, detail)]
        if edge.its_s is None:
            assert self._chain is not None
            place = self._chain.place(raw_ns)
            return [self._refuse(edge, Why.OFF_GRID, f"{place.error_ns} ns off second {place.its_s}")]
        return [self._refuse(edge, *self._statements.why(edge.pulse, edge.its_s))]

    def _refuse(self, edge: _Edge, why: Why, detail: str) -> Refused:
        refused = Refused(why, edge.pulse, detail)
        self.refused[why] += 1
        self.samples[why] = refused
        return refused
