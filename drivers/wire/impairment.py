"""Impairments of a lossy link: loss, bursts, delay, jitter, reordering, copies, bit errors.

The outcome is reproducible: the same seed, frames and settings have the same result, whatever the times of arrival.
Each kind of impairment has its own random numbers. An added delay therefore does not change which frames are lost.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from heapq import heappop, heappush
from math import log, log1p
from random import Random
from typing import Generic, NamedTuple, TypeVar

from board.runtime.errors import ConfigurationError

T = TypeVar("T")

# Limit of frames in transit: 5 s of two full channels. With a longer delay, further frames count as overflow.
MOST_WAITING = 20_000
NEVER = 2.0**62  # bits until the next bit error
SHARES = ("loss", "reorder", "duplicate", "bit_errors")
TIMES = ("delay_s", "jitter_s", "reorder_s")


class Burst(NamedTuple):
    """Gilbert-Elliott channel: two states, with a possible change of state before each frame.

    to_bad, to_good  probability of a change to that state.
    bad, good        probability of a loss in that state.

    The channel is in the bad state for a share of to_bad / (to_bad + to_good) of all frames, on average for 1 / to_good
    frames in a row.
    Source: E. O. Elliott, Estimates of error rates for codes on burst-noise channels, 1963; the four numbers are
    p, r, 1 - h and 1 - k of `tc netem loss gemodel`.
    """

    to_bad: float
    to_good: float
    bad: float = 1.0
    good: float = 0.0


@dataclass(frozen=True)
class Impairments:
    """Settings of a lossy link; the defaults change nothing. Shares are 0 ... 1.

    loss        share of frames that are lost, each independently.
    burst       additional losses of many frames in a row.
    delay_s     delay of every frame.
    jitter_s    additional random delay, uniform from 0 to this. It keeps the order: a frame waits for those before it.
    reorder     share of frames that are delayed by reorder_s more; later frames overtake them.
    duplicate   share of frames that arrive twice.
    bit_errors  share of all bits that are inverted.

    Raises ConfigurationError for a share outside 0 ... 1, and for a time outside 0 ... 3600 s.
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
                raise ConfigurationError(f"{name}: share out of range: {value:g}", "a share is 0 to 1")
        for name in TIMES:
            if not 0.0 <= getattr(self, name) <= 3600.0:
                raise ConfigurationError(f"{name}: {getattr(self, name):g} s is not in 0 ... 3600")


@dataclass
class Counts:
    """Numbers of frames. taken + duplicated = lost + burst_lost + overflow + given + frames still in transit.

    lost         lost by the setting loss.
    burst_lost   lost by the setting burst.
    overflow     dropped because the queue of frames in transit was full.
    given        delivered, copies included.
    duplicated   copies made.
    overtaken    delivered after a frame that was taken later (a reordered packet of RFC 4737 clause 3).
    wrong        frames with bit errors that were not lost.
    wrong_bits   inverted bits in those frames.
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
    """Delivered frame. about: the object that the caller passed to take() together with the frame."""

    octets: bytes
    about: T


class _Waiting(NamedTuple, Generic[T]):
    """Frame in transit. The heap sorts by due, then by place."""

    due: float
    place: int
    number: int
    given: Given[T]


class Impairment(Generic[T]):
    """Lossy link: take() accepts frames, due() delivers them. now is in seconds of any monotonic clock."""

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
        """Accept a frame: lose it, or put it and a possible copy in transit."""
        wanted, counts = self._wanted, self.counts
        counts.taken += 1
        # Every kind of impairment draws its random numbers for each frame, lost or not. So no kind changes another one.
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
        """Yield the frames that are due by now, in order of delivery."""
        counts = self.counts
        while self._waiting and self._waiting[0].due <= now:
            one = heappop(self._waiting)
            counts.given += 1
            counts.overtaken += one.number < self._last_given
            self._last_given = max(self._last_given, one.number)
            yield one.given

    def deadline(self) -> float | None:
        """Return the time when the next frame is due; None without a frame in transit."""
        return self._waiting[0].due if self._waiting else None

    @property
    def waiting(self) -> int:
        """Number of frames in transit."""
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
        """Return the octets with bit errors. A lost frame uses up random numbers too, but is not counted."""
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
        """Draw the number of correct bits before the next bit error, from the geometric distribution.

        One random number per error suffices.
        """
        share = self._wanted.bit_errors
        if not 0.0 < share < 1.0:
            return 0
        return int(min(log(1.0 - self._bits.random()) / log1p(-share), NEVER))
