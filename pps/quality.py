"""State and accuracy of the station's time: pulses, holdover, messages, or system clock."""

from typing import NamedTuple

from board.time.leaps import BUILT_IN, Leaps
from board.time.scales import Fix, LeapEvent, Lock, TimeQuality
from pps.messages import Messages
from pps.model import LATENCY_NS, Model
from pps.pulse import Clocks
from pps.timemark import Second

# Without pulses for this time, the state is HOLDOVER. Two pulses may be missed; the next one counts only when the
# receiver has confirmed it.
HOLDOVER_S = 3.6

# Largest error in the state LOCKED: the resolution of ITS time stamps, 1 ms.
LOCKED_NS = 1_000_000

# Growth of the system clock's error since its last report: RFC 5905, PHI.
SYSTEM_PPM = 15


class TimeEstimate(NamedTuple):
    """Current time by one source, with its largest error.

    its_ns     true time as ITS time, which has numbers for leap seconds.
    offset_ns  true time minus the system's clock.
    within_ns  largest error of its_ns.
    """

    state: Lock
    its_ns: int
    offset_ns: int
    within_ns: int


class Estimator:
    """Estimator of the station's time. It does no I/O: each input has a time by the raw clock.

    latency_ns  largest lateness of an ordinary stamp of a pulse.
    leaps       table of leap seconds; may be replaced at any time.
    source      interface of the receiver.
    """

    def __init__(self, latency_ns: int = LATENCY_NS, leaps: Leaps = BUILT_IN, source: str = "") -> None:
        self._leaps = leaps
        self.source = source
        self.model = Model(latency_ns)
        self._messages = Messages()
        self._told_ns: int | None = None  # Unix time that the receiver gave in its last message with a time
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
        """Number of times that the error exceeded its bound when pulses returned."""
        return self.model.surprises

    def second(self, second: Second) -> None:
        """Add a pulse with its second; call it in the order of time."""
        self.model.second(second)
        self._leap = second.leap_event

    def fix(self, fix: Fix, clocks: Clocks) -> None:
        """Add a recent message of the receiver; without effect if it has no time."""
        if fix.utc_ns is not None:
            self._told_ns = fix.utc_ns
            ago_ns = round((clocks.monotonic - fix.monotonic) * 1e9)
            self.message(self.leaps.its_ns(fix.utc_ns), clocks.raw_ns - ago_ns)

    def message(self, its_ns: int, raw_ns: int) -> None:
        """Add a message of the receiver: ITS time of its epoch, and raw clock at its arrival."""
        self._messages.message(its_ns, raw_ns)

    def system(self, offset_ns: int, uncertainty_ns: int, raw_ns: int) -> None:
        """Set the system clock's offset, true time minus its time, and its uncertainty, as known from other sources."""
        self._system = (offset_ns, uncertainty_ns, raw_ns)

    def estimate(self, raw_ns: int) -> tuple[int, int] | None:
        """Return true time (ITS ns) by pulses at a moment of the raw clock, and its largest error; None without any."""
        return self.model.estimate(raw_ns)

    def best(self, clocks: Clocks) -> TimeEstimate | None:
        """Return the best estimate: by pulses while LOCKED, else by the source with the smallest error."""
        said = self._by_pulses(clocks) + self._by_messages(clocks) + self._by_system(clocks)
        return min(said, key=lambda one: (one.state is not Lock.LOCKED, one.within_ns), default=None)

    def quality(self, clocks: Clocks) -> TimeQuality:
        """Return the quality of the current time, by the best estimate."""
        best = self.best(clocks)
        if best is None:
            return TimeQuality(source=self.source)
        state, _, offset_ns, uncertainty_ns = best
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

    def _by_pulses(self, clocks: Clocks) -> list[TimeEstimate]:
        known = self.model.estimate(clocks.raw_ns)
        if known is None:
            return []
        state = Lock.LOCKED if known[1] <= LOCKED_NS and not self.model.is_settling else Lock.SETTLING
        if self.model.age_s(clocks.raw_ns) > HOLDOVER_S:
            state = Lock.HOLDOVER
        return [self._estimate(state, known, clocks)]

    def _by_messages(self, clocks: Clocks) -> list[TimeEstimate]:
        known = self._messages.estimate(clocks.raw_ns)
        return [self._estimate(Lock.COARSE, known, clocks)] if known else []

    def _by_system(self, clocks: Clocks) -> list[TimeEstimate]:
        if self._system is None:
            return []
        offset_ns, uncertainty_ns, raw_ns = self._system
        within_ns = uncertainty_ns + abs(clocks.raw_ns - raw_ns) * SYSTEM_PPM // 1_000_000
        return [TimeEstimate(Lock.SYSTEM, self.leaps.its_ns(clocks.system_ns + offset_ns), offset_ns, within_ns)]

    def _estimate(self, state: Lock, known: tuple[int, int], clocks: Clocks) -> TimeEstimate:
        its_ns, within_ns = known
        return TimeEstimate(state, its_ns, self.leaps.unix_ns(its_ns) - clocks.system_ns, within_ns)
