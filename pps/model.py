"""Model of true time over the raw clock: a line and its uncertainty."""

from typing import NamedTuple

from pps.chain import DRIFT_PPM, SECOND_NS
from pps.holdover import HoldoverEstimator
from pps.lateness import Lateness
from pps.settling import ENOUGH, Settling
from pps.timemark import Second
from pps.tracker import Trackers

# A stamp of the kernel is always later than its edge, by SHORTEST times to once the latency; pulses cannot show how
# much. Published: 4.4 us for a Raspberry Pi 4 (PPS-Client), 7 to 20 us for a Pi 5 (satpulse, issue 460); 10 us is for
# the Pi 4. The middle of the range is subtracted from each stamp; half of the range is part of each uncertainty.
LATENCY_NS = 10_000
SHORTEST = 0.2

# Number of standard deviations that contain 99.9 % of a normal distribution.
SIGMAS = 3.3

# Largest lateness of a first pulse: the worst interrupt under heavy load.
FIRST_NS = 500_000
CRYSTAL_PPB = DRIFT_PPM * 1000

# After a silence longer than this, the first pulses are judged together before they are used.
SILENCE_S = 10.0

# Pulses further apart than this cannot form a line.
APART_S = 60.0

# Number of pulses after settling from which predictions count. Before, their errors are those of the few pulses behind
# them, and the line's own skew covers these.
SEASONED = 64

# Number of pulses over which the line's lag behind a changing oscillator is averaged.
LAGGING = 8


def unseen_latency_ns(latency_ns: int) -> float:
    """Return the constant error of stamps in ns that no pulse shows, after the middle is subtracted."""
    return latency_ns * (1 - SHORTEST) / 2


class Line(NamedTuple):
    """Line of the true time: raw_ns + base_ns + phase_ns at moment_s; the phase then changes by rate_ppb.

    moment_s             seconds of the raw clock since the first pulse.
    within_ns, skew_ppb  largest errors of phase and rate.
    """

    moment_s: float
    phase_ns: float
    rate_ppb: float
    within_ns: float
    skew_ppb: float


class Model:
    """Line of the oscillator through the pulses. Takes 10 us per pulse and 1 us per estimate.

    latency_ns   largest lateness of an ordinary stamp.
    late_ns      correction that is subtracted from each stamp.
    line         current line; None before the first pulse.
    is_settled   the line rests on enough pulses.
    is_settling  the first pulses at the start or after a silence are being collected.
    surprises    number of times that the line's error exceeded its bound when pulses returned.
    surprise_ns  error at the last of these times.
    """

    def __init__(self, latency_ns: int = LATENCY_NS) -> None:
        self.line: Line | None = None
        self.is_settled = False
        self.surprises, self.surprise_ns = 0, 0
        self.late_ns = round(latency_ns * (1 + SHORTEST) / 2)
        self._floor_ns = unseen_latency_ns(latency_ns)
        self._holdover, self._trackers, self._lateness = HoldoverEstimator(), Trackers(), Lateness(FIRST_NS)
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
        """Frequency error of the raw clock: positive if it runs fast."""
        return -self.line.rate_ppb if self.line else 0.0

    @property
    def skew_ppb(self) -> float:
        """Largest error of frequency_ppb."""
        return self.line.skew_ppb + self._holdover.rate_ppb if self.line else CRYSTAL_PPB

    def age_s(self, raw_ns: int) -> float:
        """Return the seconds since the last accepted pulse."""
        return self._moment_s(raw_ns) - self._good_s

    def estimate(self, raw_ns: int) -> tuple[int, int] | None:
        """Return true time (ITS ns) at a moment of the raw clock, and its largest error; None without a pulse."""
        line = self.line
        if line is None:
            return None
        ahead_s = self._moment_s(raw_ns) - line.moment_s
        its_ns = raw_ns + self._base_ns + round(line.phase_ns + line.rate_ppb * ahead_s)
        away_s = abs(ahead_s)
        within_ns = line.within_ns + self._lateness.doubt_ns + line.skew_ppb * away_s
        return its_ns, round(within_ns + self._holdover.bound_ns(away_s))

    def second(self, second: Second) -> None:
        """Add a pulse with its second; call it in the order of time."""
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
        """Begin a new series of seconds; discard the line if it disagrees by more than half a second."""
        self._series = series
        known = self.estimate(raw_ns)
        if known is None or abs(known[0] - its_ns) > SECOND_NS // 2:
            self._settling = Settling(self.line.rate_ppb if self.line and self.is_settled else None)
            self.line, self.is_settled = None, False
            self._first_raw_ns, self._base_ns = raw_ns, its_ns - raw_ns
            self._holdover.break_off()

    def _settle(self, settling: Settling, second: Second, moment_s: float, phase_ns: float) -> None:
        self._good_s = moment_s
        found = settling.reading(moment_s, phase_ns)
        if found is None:
            if not self.is_settled:  # the last pulse alone is the best estimate
                self.line = Line(moment_s, phase_ns, 0.0, self._floor_ns + FIRST_NS, CRYSTAL_PPB)
            return
        if self.is_settled:
            self._compare(second, moment_s, found.phase_ns)
        self._settling, self.is_settled = None, True
        self._lag_ns = self._holdover.bound_ns(found.span_s / 2)  # a straight line lags if the phase bends in this span
        self._lateness = Lateness(found.mean_ns)
        self._trackers.begin(found.phase_ns, found.rate_ppb, ENOUGH, found.mean_ns**2)
        self._draw(second, moment_s)

    def _compare(self, second: Second, moment_s: float, phase_ns: float) -> None:
        """Count the line's error when pulses return. The raw clock is never stepped, so the error is the line's."""
        line, stated = self.line, self.estimate(second.pulse.raw_ns)
        if line is None or stated is None:
            return
        ahead_s = moment_s - line.moment_s
        error_ns = abs(line.phase_ns + line.rate_ppb * ahead_s - phase_ns)
        if error_ns > stated[1]:
            self.surprises, self.surprise_ns = self.surprises + 1, round(error_ns)
        self._holdover.returned(second.its_s, ahead_s, error_ns)

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
            self._holdover.second(second.its_s, moment_s, self._trackers.best.phase, self._trackers.steady.rate)
        self._draw(second, moment_s)

    def _draw(self, second: Second, moment_s: float) -> None:
        """Draw the current line by the best-predicting tracker, with the errors that noise and lag leave in it."""
        best, steady, noise_ns = self._trackers.best, self._trackers.steady, SIGMAS * self._lateness.deviation_ns
        within_ns = self._floor_ns + SIGMAS * second.accuracy_ns + noise_ns * best.alpha**0.5 + 2 * abs(self._lag_ns)
        skew_ppb = noise_ns * (12 / steady.count**3) ** 0.5
        self.line = Line(moment_s, best.phase, steady.rate, within_ns, skew_ppb)
