"""What was sent and what was received, matched by digest: the fate of each message on one way between two interfaces.

Nothing is judged before the grace is over: what stations say comes by connections of their own, in no order between
them, and a message may be late. What was received waits so long for the word that it was sent; then it is matched.
What was sent waits as long again.
"""

from bisect import insort
from collections import OrderedDict, deque
from collections.abc import Sequence
from enum import Enum
from typing import NamedTuple

from firmware.meter.delay import link as link_delay
from firmware.meter.event import Received, Sent

GRACE_S = 2.0
# PDUs that are remembered after their fate is known, to tell what comes again from what was never sent: a minute of a
# channel that is full. 0.2 kB each.
REMEMBERED = 131_072
# A process may be put aside between reading one clock and the other: a stamp of its is then off by as much.
SLACK_NS = 5_000_000
LONE_SLACK_NS = 1_000_000_000


class Way(NamedTuple):
    """From an interface of one station to an interface of another, or of the same: a round trip."""

    sender: str
    out: str
    receiver: str
    into: str

    def __str__(self) -> str:
        names = self.out if self.out == self.into else f"{self.out} > {self.into}"
        return f"{self.sender} > {self.receiver} {names}"

    @property
    def is_round_trip(self) -> bool:
        return self.sender == self.receiver


class Fate(Enum):
    """Of what was sent, or of what was received."""

    ARRIVED = "arrived"
    LOST = "lost"
    UNSEEN = "unseen"  # it did not arrive as far as the meter has heard, and the meter has not heard all
    DUPLICATE = "duplicate"  # received once more than it was sent
    LATE = "late"  # received after it was taken for lost
    STRANGE = "strange"  # received, and not sent on this way as far as the meter has heard


class Settled(NamedTuple):
    """A fate that will not change any more, but for LOST by a later LATE.

    copy          of its PDU on this way, from 0 on: the k-th by one way is the k-th by another.
    is_reordered  something that was sent later arrived earlier (RFC 4737 clause 3.3).
    is_repeat     several copies of its PDU were under way: it was taken for the last of them.
    """

    way: Way
    fate: Fate
    sent: Sent | None
    received: Received | None
    copy: int = 0
    is_reordered: bool = False
    is_repeat: bool = False


class _Out:
    __slots__ = ("copy", "has_arrived", "number", "sent")

    def __init__(self, sent: Sent, number: int, copy: int) -> None:
        self.sent = sent
        self.number = number
        self.copy = copy
        self.has_arrived = False


class _Known:
    """What is remembered of a PDU: copies sent, and of them those that count as lost."""

    __slots__ = ("lost", "sent")

    def __init__(self) -> None:
        self.sent = self.lost = 0


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
    """

    def __init__(self, way: Way, grace_s: float = GRACE_S, remembered: int = REMEMBERED) -> None:
        self.way = way
        self.grace_s = grace_s
        self._remembered = remembered
        self._outs: deque[_Out] = deque()
        self._ins: list[Received] = []  # by when they came: a station may tell of what is urgent first
        self._open: dict[str, list[_Out]] = {}  # that have not arrived, in their order
        self._known: OrderedDict[str, _Known] = OrderedDict()
        self._unheard: deque[_Unheard] = deque()
        self._numbers = 0
        self._highest = -1  # number of the last sent of those that arrived

    def sent(self, event: Sent) -> None:
        digest = event.what.digest
        known = self._known.get(digest)
        if known is None:
            known = self._known[digest] = _Known()
            if len(self._known) > self._remembered:
                self._known.popitem(last=False)
        else:
            self._known.move_to_end(digest)
        out = _Out(event, self._numbers, known.sent)
        self._numbers += 1
        known.sent += 1
        self._outs.append(out)
        self._open.setdefault(digest, []).append(out)

    def received(self, event: Received) -> None:
        insort(self._ins, event, key=_when)

    def unheard(self, count: float, since_s: float, until_s: float) -> None:
        """So many reports of the receiver were missed between these moments; math.inf: nobody knows how many."""
        self._unheard.append(_Unheard(count, since_s, until_s))

    def settle(self, now_s: float) -> list[Settled]:
        """The fates that are known by now: of what was received in its order, then of what was not; math.inf: all."""
        settled: list[Settled] = []
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
        return settled

    def _came(self, received: Received) -> Settled:
        digest = received.what.digest
        candidates = _plausible(self._open.get(digest, ()), received)
        if candidates:
            # By clocks it is the last that was sent before; without them they are taken in the order of sending.
            out = candidates[-1] if _delay_ns(candidates[0], received) is not None else candidates[0]
            out.has_arrived = True
            self._close(digest, out)
            is_reordered = out.number < self._highest
            self._highest = max(self._highest, out.number)
            return Settled(self.way, Fate.ARRIVED, out.sent, received, out.copy, is_reordered, len(candidates) > 1)
        known = self._known.get(digest)
        if known is None:
            return Settled(self.way, Fate.STRANGE, None, received)
        if known.lost:
            known.lost -= 1
            return Settled(self.way, Fate.LATE, None, received)
        return Settled(self.way, Fate.DUPLICATE, None, received)

    def _not_arrived(self, out: _Out) -> Settled:
        digest = out.sent.what.digest
        self._close(digest, out)
        fate = Fate.UNSEEN if self._was_unheard(out.sent.at_s) else Fate.LOST
        if fate is Fate.LOST and (known := self._known.get(digest)):
            known.lost += 1
        return Settled(self.way, fate, out.sent, None, out.copy)

    def _was_unheard(self, at_s: float) -> bool:
        for one in self._unheard:
            if one.count > 0 and one.since_s - self.grace_s <= at_s <= one.until_s + self.grace_s:
                one.count -= 1
                return True
        return False

    def _close(self, digest: str, out: _Out) -> None:
        left = self._open[digest]
        left.remove(out)
        if not left:
            del self._open[digest]


def _when(received: Received) -> int:
    return received.received_ns


def _plausible(outs: Sequence[_Out], received: Received) -> list[_Out]:
    """Those that it can be: nothing arrives before it was sent, as far as clocks and stamps tell.

    The only one of its digest is believed further: its stamps may be worse than they are said to be.
    """
    slack_ns = LONE_SLACK_NS if len(outs) == 1 else SLACK_NS
    delays = ((out, _delay_ns(out, received)) for out in outs)
    return [out for out, delay_ns in delays if delay_ns is None or delay_ns >= -slack_ns]


def _delay_ns(out: _Out, received: Received) -> int | None:
    """The longest that it can have been under way."""
    delay = link_delay(out.sent, received)
    return None if delay is None else delay.ns + delay.uncertainty_ns
