"""True time as the raw clock goes, by pulses: a line, how far off it may be, and what it has learnt of itself."""

from typing import NamedTuple

from pps.chain import DRIFT_PPM, SECOND_NS
from pps.foresight import Foresight
from pps.lateness import Lateness
from pps.settling import ENOUGH, Settling
from pps.timemark import Second
from pps.tracker import Trackers

# A stamp of the kernel is later than its edge by something between a fifth of this and all of it, every time, and no
# pulse shows by how much. Published: 4.4 us of a Raspberry Pi 4 (PPS-Client), 7 to 20 us of a Pi 5 (satpulse, issue
# 460); 10 us is for the first. The middle is taken off every stamp, half of the rest stays in every uncertainty.
LATENCY_NS = 10_000
SHORTEST = 0.2

# 99.9 % of a normal distribution are within so many standard deviations.
SIGMAS = 3.3

# A first pulse may have waited so long: the worst of an interrupt beside heavy work.
FIRST_NS = 500_000
CRYSTAL_PPB = DRIFT_PPM * 1000

# After a silence of so long the first pulses are looked at together before they are believed.
SILENCE_S = 10.0

# Pulses further apart than this make no line together.
APART_S = 60.0

# So many pulses after settling predictions begin to count: before, they are as good as the few pulses behind them,
# which the line's own skew says.
SEASONED = 64

# Pulses by which it shows that the line lags behind a clock that turns.
LAGGING = 8


def unseen_latency_ns(latency_ns: int) -> float:
    """How far stamps may be off all the time, without any pulse showing it, when the middle is taken off."""
    return latency_ns * (1 - SHORTEST) / 2


class Line(NamedTuple):
    """True time is raw_ns + base_ns + phase_ns at moment_s, and the phase changes by rate_ppb from there on.

    moment_s  of the raw clock, in seconds since the first pulse.
    within_ns, skew_ppb  how far off phase and rate may be.
    """

    moment_s: float
    phase_ns: float
    rate_ppb: float
    within_ns: float
    skew_ppb: float


class Model:
    """The oscillator's line through the pulses. 10 us of work for each, 1 us for an estimate.

    latency_ns   the most that an ordinary stamp of a pulse is late. late_ns: what is taken off every stamp.
    line         None before the first pulse. is_settled: it has been drawn through enough of them.
    is_settling  the first pulses, or the first after a silence, are being collected.
    surprises    times that pulses came back and the line was further off than had been stated: by surprise_ns, last.
    """

    def __init__(self, latency_ns: int = LATENCY_NS) -> None:
        self.line: Line | None = None
        self.is_settled = False
        self.surprises, self.surprise_ns = 0, 0
        self.late_ns = round(latency_ns * (1 + SHORTEST) / 2)
        self._floor_ns = unseen_latency_ns(latency_ns)
        self._foresight, self._trackers, self._lateness = Foresight(), Trackers(), Lateness(FIRST_NS)
        self._settling: Settling | None = None
        self._series = self._first_raw_ns = self._base_ns = 0
        self._good_s = self._lag_ns = 0.0

    @property
    def is_settling(self) -> bool:
        return self._settling is not None

    @property
    def jitter_ns(self) -> float:
        """Standard deviation of ordinary pulses about the line."""
        return self._lateness.deviation_ns

    @property
    def frequency_ppb(self) -> float:
        """Of the raw clock against the truth: positive where it runs fast."""
        return -self.line.rate_ppb if self.line else 0.0

    @property
    def skew_ppb(self) -> float:
        """How far off that may be."""
        return self.line.skew_ppb + self._foresight.rate_ppb if self.line else CRYSTAL_PPB

    def age_s(self, raw_ns: int) -> float:
        """Since the last pulse that was believed."""
        return self._moment_s(raw_ns) - self._good_s

    def estimate(self, raw_ns: int) -> tuple[int, int] | None:
        """True time (ITS ns) at a moment of the raw clock, and how far off that may be; None before the first pulse."""
        line = self.line
        if line is None:
            return None
        ahead_s = self._moment_s(raw_ns) - line.moment_s
        its_ns = raw_ns + self._base_ns + round(line.phase_ns + line.rate_ppb * ahead_s)
        away_s = abs(ahead_s)
        within_ns = line.within_ns + self._lateness.doubt_ns + line.skew_ppb * away_s
        return its_ns, round(within_ns + self._foresight.bound_ns(away_s))

    def second(self, second: Second) -> None:
        """A pulse and its second, in the order of time."""
        raw_ns, its_ns = second.pulse.raw_ns, second.its_s * SECOND_NS + self.late_ns
        if second.series != self._series:
            self._acquire(second.series, raw_ns, its_ns)
        moment_s, phase_ns = self._moment_s(raw_ns), float(its_ns - raw_ns - self._base_ns)
        limit_s = SILENCE_S if self._settling is None else APART_S
        if moment_s - self._good_s > limit_s:
            self._settling = Settling(self._trackers.steady.rate if self.is_settled else None)
        if self._settling is None:
            self._track(second, moment_s, phase_ns)
        else:
            self._settle(self._settling, second, moment_s, phase_ns)

    def _moment_s(self, raw_ns: int) -> float:
        return (raw_ns - self._first_raw_ns) * 1e-9

    def _acquire(self, series: int, raw_ns: int, its_ns: int) -> None:
        """Seconds are counted anew: where they are others than the line's, it was wrong and is none any more."""
        self._series = series
        known = self.estimate(raw_ns)
        if known is None or abs(known[0] - its_ns) > SECOND_NS // 2:
            self._settling = Settling(self.line.rate_ppb if self.line and self.is_settled else None)
            self.line, self.is_settled = None, False
            self._first_raw_ns, self._base_ns = raw_ns, its_ns - raw_ns
            self._foresight.break_off()

    def _settle(self, settling: Settling, second: Second, moment_s: float, phase_ns: float) -> None:
        self._good_s = moment_s
        found = settling.reading(moment_s, phase_ns)
        if found is None:
            if not self.is_settled:  # nothing is better than the last pulse
                self.line = Line(moment_s, phase_ns, 0.0, self._floor_ns + FIRST_NS, CRYSTAL_PPB)
            return
        if self.is_settled:
            self._compare(second, moment_s, found.phase_ns)
        self._settling, self.is_settled = None, True
        self._lag_ns = self._foresight.bound_ns(found.span_s / 2)  # where it bends within, a straight line lags
        self._lateness = Lateness(found.mean_ns)
        self._trackers.begin(found.phase_ns, found.rate_ppb, ENOUGH, found.mean_ns**2)
        self._draw(second, moment_s)

    def _compare(self, second: Second, moment_s: float, phase_ns: float) -> None:
        """Pulses are back: how good was the line without them? The raw clock is not stepped: it is the line's error."""
        line, stated = self.line, self.estimate(second.pulse.raw_ns)
        if line is None or stated is None:
            return
        ahead_s = moment_s - line.moment_s
        error_ns = abs(line.phase_ns + line.rate_ppb * ahead_s - phase_ns)
        if error_ns > stated[1]:
            self.surprises, self.surprise_ns = self.surprises + 1, round(error_ns)
        self._foresight.returned(second.its_s, ahead_s, error_ns)

    def _track(self, second: Second, moment_s: float, phase_ns: float) -> None:
        best = self._trackers.best
        elapsed_s = moment_s - self._good_s
        foretold_ns = best.phase + best.rate * elapsed_s
        late_ns = self._lateness.believed_ns(foretold_ns - phase_ns)
        if late_ns is None:
            return
        self._trackers.reading(elapsed_s, foretold_ns - late_ns)
        self._lag_ns += (late_ns - self._lag_ns) / LAGGING
        self._good_s = moment_s
        if self._trackers.count >= SEASONED:
            self._foresight.second(second.its_s, moment_s, self._trackers.best.phase, self._trackers.steady.rate)
        self._draw(second, moment_s)

    def _draw(self, second: Second, moment_s: float) -> None:
        """The line of now: by the memory that foretells best, with the errors that noise and lag leave in it."""
        best, steady, noise_ns = self._trackers.best, self._trackers.steady, SIGMAS * self._lateness.deviation_ns
        within_ns = self._floor_ns + SIGMAS * second.accuracy_ns + noise_ns * best.alpha**0.5 + 2 * abs(self._lag_ns)
        skew_ppb = noise_ns * (12 / steady.count**3) ** 0.5
        self.line = Line(moment_s, best.phase, steady.rate, within_ns, skew_ppb)
