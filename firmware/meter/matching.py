"""Matching of sent and received messages by digest, between two interfaces.

No message is judged before the grace time is over. The reason: messages may be late, and reports of stations come by
different connections in any order. A reception waits for the report of its sending, then it is matched. A sent message
waits as long again. A later report still corrects the result.
"""

import math
from bisect import insort
from collections import OrderedDict, deque
from collections.abc import Sequence
from typing import Generic, TypeVar

from firmware.meter.delay import link as link_delay
from firmware.meter.event import ReceivedEvent, Sent
from firmware.meter.fate import Fate, Settled, Way

GRACE_S = 2.0
# PDUs remembered after their fate is known, to distinguish duplicates from messages that were never sent. The limit is
# a minute of a full channel, with 0.2 kB each.
REMEMBERED = 131_072
# A late report is still matched within this time, for example of a station that was silent or a message that a broker
# kept.
LATEST_S = 60.0
MOST_STRAYS = 16_384
# A process may be suspended between its readings of two clocks, which makes a stamp wrong by this much.
SLACK_NS = 5_000_000
LONE_SLACK_NS = 1_000_000_000


class _Out:
    __slots__ = ("copy", "fate", "has_arrived", "is_unheard", "number", "sent")

    def __init__(self, sent: Sent, number: int, copy: int) -> None:
        self.sent = sent
        self.number = number
        self.copy = copy
        self.has_arrived = self.is_unheard = False
        self.fate = Fate.LOST  # the fate reported for it


class _Unheard:
    """Span in which the meter missed `count` reports of the receiver."""

    __slots__ = ("count", "since_s", "until_s")

    def __init__(self, count: float, since_s: float, until_s: float) -> None:
        self.count = count
        self.since_s = since_s
        self.until_s = until_s


class Matching:
    """Matching for one direction. Sent events are given in the order in which messages left.

    grace_s  seconds to wait for the report of one end after that of the other.
    since_s  time from which the sender's reports are received. Copies of a repeatedly sent PDU may have been under way
             then.
    """

    def __init__(self, way: Way, grace_s: float = GRACE_S, remembered: int = REMEMBERED) -> None:
        self.way = way
        self.grace_s = grace_s
        self.since_s = -math.inf
        self._remembered = remembered
        self._outs: deque[_Out] = deque()
        self._ins: list[ReceivedEvent] = []  # by time of arrival: a station may report urgent messages first
        self._open: dict[str, list[_Out]] = {}  # not arrived yet, in order of sending
        self._copies: OrderedDict[str, int] = OrderedDict()  # number of copies sent of each PDU
        self._waiting: dict[str, list[ReceivedEvent]] = {}  # the events of _ins by digest
        # PDUs of which the matched copy is a guess, with the time of the last guess
        self._guessed: OrderedDict[str, float] = OrderedDict()
        self._missing = _Late[_Out]()
        self._strays = _Late[ReceivedEvent]()
        self._corrected: list[Settled] = []
        self._unheard: deque[_Unheard] = deque()
        self._silences: deque[tuple[float, float]] = deque()
        self._numbers = 0
        self._highest = -1  # number of the latest sent message among those that arrived

    def sent(self, event: Sent) -> None:
        digest = event.what.digest
        copy = self._copies.pop(digest, 0)
        self._copies[digest] = copy + 1
        if copy == 0 and event.at_s <= self.since_s + 2 * self.grace_s:
            self._guess(digest, event.at_s)
        if len(self._copies) > self._remembered:
            self._copies.popitem(last=False)
        out = _Out(event, self._numbers, copy)
        self._numbers += 1
        for stray in self._strays.of(digest):  # reception reported first, as the sender was silent
            if _plausible([out], stray):
                self._strays.take(digest, stray)
                fate = self._fate(event, stray, is_repeat=False)
                self._corrected.append(Settled(self.way, fate, event, stray, copy, was=Fate.STRANGE))
                return
        self._outs.append(out)
        self._open.setdefault(digest, []).append(out)

    def received(self, event: ReceivedEvent) -> None:
        insort(self._ins, event, key=_when)
        insort(self._waiting.setdefault(event.what.digest, []), event, key=_when)

    def unheard(self, count: float, since_s: float, until_s: float) -> None:
        """Note that reports of the receiver were missed between two times.

        The count is math.inf if the number of missed reports is unknown.
        """
        self._unheard.append(_Unheard(count, since_s, until_s))

    def silent(self, since_s: float, until_s: float) -> None:
        """Note that reports of the sender may be missing between two times; until_s: math.inf for an open end."""
        if self._silences and self._silences[-1][0] == since_s:
            self._silences.pop()
        self._silences.append((since_s, until_s))

    def settle(self, now_s: float) -> list[Settled]:
        """Return the fates that are known by now, those of received messages first; now_s: math.inf to settle all."""
        settled, self._corrected = self._corrected, []
        until_s = now_s - self.grace_s
        ready = next((at for at, one in enumerate(self._ins) if one.at_s > until_s), len(self._ins))
        settled += map(self._came, self._ins[:ready])
        del self._ins[:ready]
        until_s -= self.grace_s
        while self._outs and self._outs[0].sent.at_s <= until_s:
            out = self._outs.popleft()
            if not out.has_arrived:
                settled.append(self._not_arrived(out))
        while self._unheard and self._unheard[0].until_s < until_s - self.grace_s:
            self._unheard.popleft()
        while self._silences and self._silences[0][1] < until_s - self.grace_s:
            self._silences.popleft()
        self._missing.forget(until_s - LATEST_S)
        self._strays.forget(until_s - LATEST_S)
        return settled

    def _came(self, received: ReceivedEvent) -> Settled:
        digest = received.what.digest
        waiting = _without(self._waiting, digest, received)
        candidates = _plausible(self._open.get(digest, ()), received)
        if candidates:
            out = self._chosen(candidates, received, waiting)
            out.has_arrived = True
            _without(self._open, digest, out)
            is_repeat = self._is_guess(digest, len(candidates) > 1, received.at_s)
            is_reordered = out.number < self._highest and not is_repeat and self._copies.get(digest, 1) == 1
            self._highest = max(self._highest, out.number)
            fate, is_unheard = self._fate(out.sent, received, is_repeat), self._span(out.sent.at_s) is not None
            return Settled(self.way, fate, out.sent, received, out.copy, is_reordered, is_repeat, None, is_unheard)
        for out in self._missing.of(digest):
            if _plausible([out], received):
                self._missing.take(digest, out)
                is_repeat = self._copies.get(digest, 1) > 1
                is_reordered = out.number < self._highest and not is_repeat
                fate = self._fate(out.sent, received, is_repeat)
                is_unheard = out.is_unheard
                return Settled(
                    self.way, fate, out.sent, received, out.copy, is_reordered, is_repeat, out.fate, is_unheard
                )
        if digest not in self._copies:
            self._strays.add(digest, received, received.at_s)
        elif not self._may_be_another(digest, received.at_s):
            return Settled(self.way, Fate.DUPLICATE, None, received)
        return Settled(self.way, Fate.STRANGE, None, received)

    def _may_be_another(self, digest: str, at_s: float) -> bool:
        """Whether a reception may be a copy whose sending was not reported to the meter.

        It may be in a span without reports of the sender. For a PDU known to be sent repeatedly, the span lasts
        grace_s longer. For a PDU that was sent once, it begins grace_s later.
        """
        again_s, once_s = (self.grace_s, 0.0) if self._copies[digest] > 1 else (0.0, self.grace_s)
        spans = ((-math.inf, self.since_s), *self._silences)
        return any(since_s + once_s <= at_s <= until_s + again_s for since_s, until_s in spans)

    def _fate(self, sent: Sent, received: ReceivedEvent, is_repeat: bool) -> Fate:
        """Return whether a message arrived in time or late.

        The delay is measured by clocks if their accuracy is known, otherwise by the arrival of both reports at the
        meter.
        """
        delay = None if is_repeat else link_delay(sent, received)
        took_s = received.at_s - sent.at_s if delay is None else delay.ns / 1e9
        return Fate.LATE if took_s > self.grace_s else Fate.ARRIVED

    def _is_guess(self, digest: str, is_one: bool, at_s: float) -> bool:
        """Whether the matched copy of a PDU is a guess.

        Once a copy may have been mistaken for another, all following ones are guesses until a pause: the mistake shifts
        them by the same interval.
        """
        if self._copies.get(digest, 1) == 1:
            return False
        if is_one or at_s - self._guessed.get(digest, -math.inf) <= 2 * self.grace_s:
            self._guess(digest, at_s)
            return True
        return False

    def _guess(self, digest: str, at_s: float) -> None:
        self._guessed.pop(digest, None)
        self._guessed[digest] = at_s
        if len(self._guessed) > MOST_STRAYS:
            self._guessed.popitem(last=False)

    def _chosen(self, candidates: list[_Out], received: ReceivedEvent, waiting: Sequence[ReceivedEvent]) -> _Out:
        """Return the sent copy that a reception is matched to.

        Without known clocks, copies are matched in order. With clocks, the last copy sent before the reception is
        matched. The first one is matched if as many copies have arrived as were sent so far: then the delay exceeds the
        interval of sending.
        """
        if len(candidates) == 1 or _delay_ns(candidates[0], received) is None:
            return candidates[0]
        later = [out for out in self._open[received.what.digest] if out.number > candidates[-1].number]
        came = [one for one in waiting if not later or not _is_after(later[0], one)]
        return candidates[0] if 1 + len(came) >= len(candidates) else candidates[-1]

    def _not_arrived(self, out: _Out) -> Settled:
        digest = out.sent.what.digest
        _without(self._open, digest, out)
        span = self._span(out.sent.at_s)
        out.is_unheard = span is not None
        if span is not None and span.count > 0:
            span.count -= 1
            out.fate = Fate.UNSEEN
        self._missing.add(digest, out, out.sent.at_s)
        return Settled(self.way, out.fate, out.sent, None, out.copy, is_unheard=out.is_unheard)

    def _span(self, at_s: float) -> _Unheard | None:
        """Return a span with missed reports at a time.

        If there are several spans, returns the one with most reports that are still unexplained.
        """
        found = [one for one in self._unheard if one.since_s - self.grace_s <= at_s <= one.until_s + self.grace_s]
        return max(found, key=lambda one: one.count, default=None)


_One = TypeVar("_One")


class _Late(Generic[_One]):
    """Unmatched events by digest, kept for late reports: for LATEST_S, and at most MOST_STRAYS of them."""

    def __init__(self) -> None:
        self._by_digest: dict[str, list[_One]] = {}
        self._order: deque[tuple[float, str, _One]] = deque()

    def add(self, digest: str, one: _One, at_s: float) -> None:
        self._by_digest.setdefault(digest, []).append(one)
        self._order.append((at_s, digest, one))
        if len(self._order) > MOST_STRAYS:
            self._forget_first()

    def of(self, digest: str) -> Sequence[_One]:
        return self._by_digest.get(digest, ())

    def take(self, digest: str, one: _One) -> None:
        _without(self._by_digest, digest, one)

    def forget(self, until_s: float) -> None:
        while self._order and self._order[0][0] < until_s:
            self._forget_first()

    def _forget_first(self) -> None:
        _, digest, one = self._order.popleft()
        if any(kept is one for kept in self.of(digest)):
            self.take(digest, one)


def _without(pool: dict[str, list[_One]], digest: str, one: _One) -> Sequence[_One]:
    """Remove an event from a pool; return the others with its digest."""
    left = pool[digest]
    del left[next(at for at, kept in enumerate(left) if kept is one)]
    if not left:
        del pool[digest]
    return left


def _when(received: ReceivedEvent) -> int:
    return received.received_ns


def _plausible(outs: Sequence[_Out], received: ReceivedEvent) -> list[_Out]:
    """Return the sent copies that a reception can match: none that was sent after it, as far as clocks show.

    A single candidate is accepted with a larger error, since its stamps may be worse than stated.
    """
    slack_ns = LONE_SLACK_NS if len(outs) == 1 else SLACK_NS
    delays = ((out, _delay_ns(out, received)) for out in outs)
    return [out for out, delay_ns in delays if delay_ns is None or delay_ns >= -slack_ns]


def _is_after(out: _Out, received: ReceivedEvent) -> bool:
    """Whether a message can have been sent before a reception."""
    return bool(_plausible([out, out], received))


def _delay_ns(out: _Out, received: ReceivedEvent) -> int | None:
    """Return the largest possible delay in ns; None if the clocks' accuracy is unknown."""
    delay = link_delay(out.sent, received)
    return None if delay is None else delay.ns + delay.uncertainty_ns
