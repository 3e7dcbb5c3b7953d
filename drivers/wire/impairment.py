"""What a bad way does to frames: loss, bursts of it, delay, jitter, reordering, copies, bit errors; counted each.

The same seed, frames and settings give the same fate of every frame, whenever they come. Each kind of trouble has
random numbers of its own: with a delay added, the same frames are lost.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from heapq import heappop, heappush
from math import log, log1p
from random import Random
from typing import Generic, NamedTuple, TypeVar

from board.errors import ConfigurationError

T = TypeVar("T")

# Frames on their way: 5 s of two full channels. A user who asks for more delay than that has the rest counted.
MOST_WAITING = 20_000
NEVER = 2.0**62  # bits until one is wrong
SHARES = ("loss", "reorder", "duplicate", "bit_errors")
TIMES = ("delay_s", "jitter_s", "reorder_s")


class Burst(NamedTuple):
    """Gilbert and Elliott's channel of two states, which changes, if it does, before each frame.

    to_bad, to_good  chance of a change of the state.
    bad, good        chance of a loss in the state.

    It is in the bad state for a share of to_bad / (to_bad + to_good), for 1 / to_good frames at a time.
    Source: E. O. Elliott, Estimates of error rates for codes on burst-noise channels, 1963; the four numbers are
    p, r, 1 - h and 1 - k of `tc netem loss gemodel`.
    """

    to_bad: float
    to_good: float
    bad: float = 1.0
    good: float = 0.0


@dataclass(frozen=True)
class Impairments:
    """What shall happen to frames; by default nothing. Shares are 0 ... 1.

    loss        this share is lost, each frame by itself.
    burst       lost besides, many in a row.
    delay_s     each comes so much later.
    jitter_s    up to so much later still, evenly spread. It changes no order: who is overtaken waits.
    reorder     this share is held back for reorder_s, and what comes meanwhile overtakes it.
    duplicate   this share comes twice.
    bit_errors  this share of all bits is wrong.
    """

    loss: float = 0.0
    burst: Burst | None = None
    delay_s: float = 0.0
    jitter_s: float = 0.0
    reorder: float = 0.0
    reorder_s: float = 0.02
    duplicate: float = 0.0
    bit_errors: float = 0.0
    seed: int = 1

    def __post_init__(self) -> None:
        shares = {name: getattr(self, name) for name in SHARES}
        shares |= {f"burst.{name}": value for name, value in (self.burst._asdict() if self.burst else {}).items()}
        for name, value in shares.items():
            if not 0.0 <= value <= 1.0:
                raise ConfigurationError(f"{name}: {value:g} is no share", "0 is none of all, 1 is all")
        for name in TIMES:
            if not 0.0 <= getattr(self, name) <= 3600.0:
                raise ConfigurationError(f"{name}: {getattr(self, name):g} s is not in 0 ... 3600")


@dataclass
class Counts:
    """Frames. taken + duplicated = lost + burst_lost + overflow + given + those on their way.

    lost         by loss. burst_lost: by the burst.
    overflow     more were on their way than is kept.
    given        came out, copies among them.
    duplicated   copies made.
    overtaken    came out after one that was taken later (a reordered packet of RFC 4737 clause 3).
    wrong        came in with bit errors; wrong_bits: of all of them.
    """

    taken: int = 0
    lost: int = 0
    burst_lost: int = 0
    overflow: int = 0
    given: int = 0
    duplicated: int = 0
    overtaken: int = 0
    wrong: int = 0
    wrong_bits: int = 0


class Given(NamedTuple, Generic[T]):
    """A frame at the end of the way; about is what was said of it at its beginning."""

    octets: bytes
    about: T


class _Waiting(NamedTuple, Generic[T]):
    """On its way: the first two decide whose turn it is."""

    due: float
    place: int
    number: int
    given: Given[T]


class Impairment(Generic[T]):
    """A way: take() what goes in, due() what comes out; now is any clock that never goes back, in seconds."""

    def __init__(self, wanted: Impairments, most_waiting: int = MOST_WAITING) -> None:
        self.counts = Counts()
        self._wanted = wanted
        self._most = most_waiting
        self._waiting: list[_Waiting[T]] = []
        self._is_bad = False
        self._place = 0
        self._last_due = float("-inf")
        self._last_given = 0
        chance = {
            kind: Random(f"{wanted.seed} {kind}") for kind in ("loss", "burst", "jitter", "order", "copy", "bits")
        }
        self._loss, self._burst, self._jitter, self._order, self._copy, self._bits = chance.values()
        self._until_wrong = self._next_wrong()

    def take(self, octets: bytes, now: float, about: T) -> None:
        """A frame goes in."""
        wanted, counts = self._wanted, self.counts
        counts.taken += 1
        # Each draws for every frame, lost or not: what one kind of trouble does is not moved by another.
        is_lost, is_burst_lost = self._hits(self._loss, wanted.loss), self._is_burst_lost()
        is_copied, is_held = self._hits(self._copy, wanted.duplicate), self._hits(self._order, wanted.reorder)
        octets = self._with_errors(octets, is_lost or is_burst_lost)
        due = now + wanted.delay_s + (wanted.jitter_s * self._jitter.random() if wanted.jitter_s else 0.0)
        if is_lost:
            counts.lost += 1
        elif is_burst_lost:
            counts.burst_lost += 1
        else:
            if is_held:
                due += wanted.reorder_s
            else:
                due = self._last_due = max(due, self._last_due)
            counts.duplicated += is_copied
            for _ in range(1 + is_copied):
                self._wait(due, Given(octets, about))

    def due(self, now: float) -> Iterator[Given[T]]:
        """The frames that have come out by now, in their order."""
        counts = self.counts
        while self._waiting and self._waiting[0].due <= now:
            one = heappop(self._waiting)
            counts.given += 1
            counts.overtaken += one.number < self._last_given
            self._last_given = max(self._last_given, one.number)
            yield one.given

    def deadline(self) -> float | None:
        """When the next comes out; None while none is on its way."""
        return self._waiting[0].due if self._waiting else None

    @property
    def waiting(self) -> int:
        """Frames on their way."""
        return len(self._waiting)

    def _wait(self, due: float, given: Given[T]) -> None:
        if len(self._waiting) >= self._most:
            self.counts.overflow += 1
            return
        self._place += 1
        heappush(self._waiting, _Waiting(due, self._place, self.counts.taken, given))

    def _is_burst_lost(self) -> bool:
        burst = self._wanted.burst
        if burst is None:
            return False
        self._is_bad ^= self._burst.random() < (burst.to_good if self._is_bad else burst.to_bad)
        return self._burst.random() < (burst.bad if self._is_bad else burst.good)

    @staticmethod
    def _hits(chance: Random, share: float) -> bool:
        return share > 0.0 and chance.random() < share

    def _with_errors(self, octets: bytes, is_lost: bool) -> bytes:
        """A lost frame has its errors too, which nobody sees."""
        if self._wanted.bit_errors == 0.0:
            return octets
        bits, wrong, flipped = len(octets) * 8, bytearray(octets), 0
        while self._until_wrong < bits:
            wrong[self._until_wrong >> 3] ^= 0x80 >> (self._until_wrong & 7)
            flipped += 1
            self._until_wrong += 1 + self._next_wrong()
        self._until_wrong -= bits
        if flipped and not is_lost:
            self.counts.wrong += 1
            self.counts.wrong_bits += flipped
        return bytes(wrong)

    def _next_wrong(self) -> int:
        """Right bits until the next wrong one: the geometric distribution, one random number an error."""
        share = self._wanted.bit_errors
        if not 0.0 < share < 1.0:
            return 0
        return int(min(log(1.0 - self._bits.random()) / log1p(-share), NEVER))
