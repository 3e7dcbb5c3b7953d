"""What time it is, and how well that is known: by pulses, by their memory, by messages, by the system's word."""

from typing import NamedTuple

from board.leaps import BUILT_IN, Leaps
from board.time import Fix, LeapEvent, Lock, TimeQuality
from pps.messages import Messages
from pps.model import LATENCY_NS, Model
from pps.pulse import Clocks
from pps.timemark import Second

# Without pulses for so long the oscillator holds the time: two may be missed, and the next one is known of when the
# receiver has confirmed it.
HOLDOVER_S = 3.6

# LOCKED is better than the resolution of any ITS time stamp, which is 1 ms.
LOCKED_NS = 1_000_000

# A system's clock may be off by this more for each second since it spoke: RFC 5905, PHI.
SYSTEM_PPM = 15


class Word(NamedTuple):
    """What a source says of the time now, and how far off that may be.

    its_ns     true time, as ITS time, which has a number for a leap second.
    offset_ns  true time less the system's clock.
    """

    state: Lock
    its_ns: int
    offset_ns: int
    within_ns: int


class Estimator:
    """The station's idea of the time. Sans-I/O: all that it is told has its moment by the raw clock.

    latency_ns  the most that an ordinary stamp of a pulse is late.
    leaps       may be set anew at any time.
    source      interface of the receiver.
    """

    def __init__(self, latency_ns: int = LATENCY_NS, leaps: Leaps = BUILT_IN, source: str = "") -> None:
        self._leaps = leaps
        self.source = source
        self.model = Model(latency_ns)
        self._messages = Messages()
        self._told_ns: int | None = None  # Unix time of the last message
        self._system: tuple[int, int, int] | None = None
        self._leap: LeapEvent | None = None

    @property
    def leaps(self) -> Leaps:
        return self._leaps

    @leaps.setter
    def leaps(self, leaps: Leaps) -> None:
        if self._told_ns is not None:
            self._messages.count_otherwise(leaps.its_ns(self._told_ns) - self._leaps.its_ns(self._told_ns))
        self._leaps = leaps

    @property
    def surprises(self) -> int:
        """Times that pulses came back and the estimate was further off than had been stated."""
        return self.model.surprises

    def second(self, second: Second) -> None:
        """A pulse and its second, in the order of time."""
        self.model.second(second)
        self._leap = second.leap_event

    def fix(self, fix: Fix, clocks: Clocks) -> None:
        """A message of the receiver that came lately; what has no time says nothing."""
        if fix.utc_ns is not None:
            self._told_ns = fix.utc_ns
            ago_ns = round((clocks.monotonic - fix.monotonic) * 1e9)
            self.message(self.leaps.its_ns(fix.utc_ns), clocks.raw_ns - ago_ns)

    def message(self, its_ns: int, raw_ns: int) -> None:
        """A message of the receiver came, and this is the ITS time of its epoch."""
        self._messages.message(its_ns, raw_ns)

    def system(self, offset_ns: int, uncertainty_ns: int, raw_ns: int) -> None:
        """What the system says of its clock, by sources other than this estimator: true less system's time."""
        self._system = (offset_ns, uncertainty_ns, raw_ns)

    def estimate(self, raw_ns: int) -> tuple[int, int] | None:
        """True time (ITS ns) by pulses at a moment of the raw clock, and how far off it may be; None without any."""
        return self.model.estimate(raw_ns)

    def word(self, clocks: Clocks) -> Word | None:
        """The best there is now: that of pulses while they come, else of the source that knows the time best."""
        said = self._by_pulses(clocks) + self._by_messages(clocks) + self._by_system(clocks)
        return min(said, key=lambda word: (word.state is not Lock.LOCKED, word.within_ns), default=None)

    def quality(self, clocks: Clocks) -> TimeQuality:
        """How well the time is known now, by that word."""
        word = self.word(clocks)
        if word is None:
            return TimeQuality(source=self.source)
        state, _, offset_ns, uncertainty_ns = word
        model = self.model
        if model.line is None:
            return TimeQuality(state, offset_ns, uncertainty_ns, source=self.source)
        return TimeQuality(
            state=state,
            offset_ns=offset_ns,
            uncertainty_ns=uncertainty_ns,
            jitter_ns=round(model.jitter_ns) if model.is_settled else None,
            frequency_ppb=model.frequency_ppb,
            skew_ppb=model.skew_ppb,
            age_s=model.age_s(clocks.raw_ns),
            leap=self._leap,
            source=self.source,
        )

    def _by_pulses(self, clocks: Clocks) -> list[Word]:
        known = self.model.estimate(clocks.raw_ns)
        if known is None:
            return []
        state = Lock.LOCKED if known[1] <= LOCKED_NS and not self.model.is_settling else Lock.SETTLING
        if self.model.age_s(clocks.raw_ns) > HOLDOVER_S:
            state = Lock.HOLDOVER
        return [self._word(state, known, clocks)]

    def _by_messages(self, clocks: Clocks) -> list[Word]:
        known = self._messages.estimate(clocks.raw_ns)
        return [self._word(Lock.COARSE, known, clocks)] if known else []

    def _by_system(self, clocks: Clocks) -> list[Word]:
        if self._system is None:
            return []
        offset_ns, uncertainty_ns, raw_ns = self._system
        within_ns = uncertainty_ns + abs(clocks.raw_ns - raw_ns) * SYSTEM_PPM // 1_000_000
        return [Word(Lock.SYSTEM, self.leaps.its_ns(clocks.system_ns + offset_ns), offset_ns, within_ns)]

    def _word(self, state: Lock, known: tuple[int, int], clocks: Clocks) -> Word:
        its_ns, within_ns = known
        return Word(state, its_ns, self.leaps.unix_ns(its_ns) - clocks.system_ns, within_ns)
