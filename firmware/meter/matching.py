"""What was sent and what was received, matched by digest: the fate of each message on one way between two interfaces.

Nothing is judged before the grace is over: what stations say comes by connections of their own, in no order between
them, and a message may be late. What was received waits so long for the word that it was sent; then it is matched.
What was sent waits as long again. A word that comes later still corrects what was said before.
"""

import math
from bisect import insort
from collections import OrderedDict, deque
from collections.abc import Sequence
from typing import Generic, TypeVar

from firmware.meter.delay import link as link_delay
from firmware.meter.event import Received, Sent
from firmware.meter.fate import Fate, Settled, Way

GRACE_S = 2.0
# PDUs that are remembered after their fate is known, to tell what comes again from what was never sent: a minute of a
# channel that is full. 0.2 kB each.
REMEMBERED = 131_072
# For so long a late word finds what it is about: of a station that was silent, or a message that a broker has kept.
LATEST_S = 60.0
MOST_STRAYS = 16_384
# A process may be put aside between reading one clock and the other: a stamp of its is then off by as much.
SLACK_NS = 5_000_000
LONE_SLACK_NS = 1_000_000_000


class _Out:
    __slots__ = ("copy", "fate", "has_arrived", "is_unheard", "number", "sent")

    def __init__(self, sent: Sent, number: int, copy: int) -> None:
        self.sent = sent
        self.number = number
        self.copy = copy
        self.has_arrived = self.is_unheard = False
        self.fate = Fate.LOST  # what it was taken for, once it was


class _Unheard:
    """A span in which the meter did not hear so many reports of the receiver."""

    __slots__ = ("count", "since_s", "until_s")

    def __init__(self, count: float, since_s: float, until_s: float) -> None:
        self.count = count
        self.since_s = since_s
        self.until_s = until_s


class Matching:
    """One way. Sent events come in the order in which they left.

    grace_s  how long one end's word is waited for after the other's.
    since_s  from when on the sender is heard: of what is sent again and again, copies may have been under way then.
    """

    def __init__(self, way: Way, grace_s: float = GRACE_S, remembered: int = REMEMBERED) -> None:
        self.way = way
        self.grace_s = grace_s
        self.since_s = -math.inf
        self._remembered = remembered
        self._outs: deque[_Out] = deque()
        self._ins: list[Received] = []  # by when they came: a station may tell of what is urgent first
        self._open: dict[str, list[_Out]] = {}  # that have not arrived, in their order
        self._copies: OrderedDict[str, int] = OrderedDict()  # sent of each PDU
        self._waiting: dict[str, list[Received]] = {}  # those of _ins, by PDU
        self._guessed: OrderedDict[str, float] = OrderedDict()  # PDUs of which one copy was taken for another, and when
        self._missing = _Late[_Out]()
        self._strays = _Late[Received]()
        self._corrected: list[Settled] = []
        self._unheard: deque[_Unheard] = deque()
        self._silences: deque[tuple[float, float]] = deque()
        self._numbers = 0
        self._highest = -1  # number of the last sent of those that arrived

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
        for stray in self._strays.of(digest):  # its station was silent, and it was received long ago
            if _plausible([out], stray):
                self._strays.take(digest, stray)
                fate = self._fate(event, stray, is_repeat=False)
                self._corrected.append(Settled(self.way, fate, event, stray, copy, was=Fate.STRANGE))
                return
        self._outs.append(out)
        self._open.setdefault(digest, []).append(out)

    def received(self, event: Received) -> None:
        insort(self._ins, event, key=_when)
        insort(self._waiting.setdefault(event.what.digest, []), event, key=_when)

    def unheard(self, count: float, since_s: float, until_s: float) -> None:
        """So many reports of the receiver were missed between these moments; math.inf: nobody knows how many."""
        self._unheard.append(_Unheard(count, since_s, until_s))

    def silent(self, since_s: float, until_s: float) -> None:
        """What the sender sent between these moments may not have been heard; math.inf: from then on."""
        if self._silences and self._silences[-1][0] == since_s:
            self._silences.pop()
        self._silences.append((since_s, until_s))

    def settle(self, now_s: float) -> list[Settled]:
        """The fates that are known by now: of what was received in its order, then of what was not; math.inf: all."""
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

    def _came(self, received: Received) -> Settled:
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
        """Whether it may be a copy that its sender sent while it was not heard.

        What is known to be sent again and again may be, for as long afterwards as a message may be under way; what was
        sent once may not, for so long after that.
        """
        again_s, once_s = (self.grace_s, 0.0) if self._copies[digest] > 1 else (0.0, self.grace_s)
        spans = ((-math.inf, self.since_s), *self._silences)
        return any(since_s + once_s <= at_s <= until_s + again_s for since_s, until_s in spans)

    def _fate(self, sent: Sent, received: Received, is_repeat: bool) -> Fate:
        """In time or late: by clocks where they tell it, else by when both were heard of."""
        delay = None if is_repeat else link_delay(sent, received)
        took_s = received.at_s - sent.at_s if delay is None else delay.ns / 1e9
        return Fate.LATE if took_s > self.grace_s else Fate.ARRIVED

    def _is_guess(self, digest: str, is_one: bool, at_s: float) -> bool:
        """Whether it is not known which copy it is: now, or since some time without a pause.

        Where one was taken for another all that follow are: they are as far from each other as what was sent.
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

    def _chosen(self, candidates: list[_Out], received: Received, waiting: Sequence[Received]) -> _Out:
        """Which of several copies of a PDU it is.

        Without clocks they are taken in their order. By clocks it is the last that was sent before; or the first, where
        as many have come as were sent until the next one was: then they are slower than they follow each other.
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
        """That of which not all was heard, of several one that has not yet explained all that is missing."""
        found = [one for one in self._unheard if one.since_s - self.grace_s <= at_s <= one.until_s + self.grace_s]
        return max(found, key=lambda one: one.count, default=None)


_One = TypeVar("_One")


class _Late(Generic[_One]):
    """What a late word may still be about, by digest: for some time, and no more than MOST_STRAYS of them."""

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
    """Take one out of a pool; returns what is left of its digest."""
    left = pool[digest]
    del left[next(at for at, kept in enumerate(left) if kept is one)]
    if not left:
        del pool[digest]
    return left


def _when(received: Received) -> int:
    return received.received_ns


def _plausible(outs: Sequence[_Out], received: Received) -> list[_Out]:
    """Those that it can be: nothing arrives before it was sent, as far as clocks and stamps tell.

    The only one of its digest is believed further: its stamps may be worse than they are said to be.
    """
    slack_ns = LONE_SLACK_NS if len(outs) == 1 else SLACK_NS
    delays = ((out, _delay_ns(out, received)) for out in outs)
    return [out for out, delay_ns in delays if delay_ns is None or delay_ns >= -slack_ns]


def _is_after(out: _Out, received: Received) -> bool:
    """Whether it can have been sent before that was received."""
    return bool(_plausible([out, out], received))


def _delay_ns(out: _Out, received: Received) -> int | None:
    """The longest that it can have been under way."""
    delay = link_delay(out.sent, received)
    return None if delay is None else delay.ns + delay.uncertainty_ns
