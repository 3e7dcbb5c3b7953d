"""Holdover estimator: bounds the error of the clock's predictions, learnt from earlier predictions."""

from bisect import bisect_right
from collections import deque
from math import exp, log2
from typing import NamedTuple

# Seconds ahead of the predictions. The bound is interpolated linearly between two horizons. Beyond the last it grows
# with this power: a random walk of the frequency, the steepest of the usual noises of oscillators (IEEE 1139).
HORIZONS_S = tuple(1 << octave for octave in range(13))
BEYOND = 1.5

# Number of pending predictions per horizon; they are made at equal intervals.
UNDER_WAY = 8

# Fraction of predictions that may exceed the bound. If fewer than 1 / RARE predictions were made, the worst error is
# raised by a tail that falls with the power TAIL. It is heavier than noise, as temperature changes are.
RARE = 0.001
TAIL = 3.0
# Largest factor by which the worst error is raised. Changes that were never observed are added by CHANGES.
RAISED = 3.0

# Half-life of observed errors: summer differs from winter.
HALF_LIFE_S = 14 * 86400

# Changes that may happen after the last pulse although none was observed: ppb, and time constant of the crystal in s.
# It is an AT cut, of 0.2 to 0.4 ppm/K. First row: a fan stops, and the air in the box is 10 K warmer at once. Second
# row: an engine starts, and the box is 15 K warmer after half an hour. (NTP assumes 15 ppm for any clock: RFC 5905,
# PHI.) The second row, above all its 20 minutes, was widened until random days of tests/pps/days were inside; it has no
# other source. A quiet day does not exclude such changes. After 1000 hours of pulses without one, it is rarer than RARE
# in the next hour, and only observed errors count. Until then, the changes fade.
CHANGES = ((3_000.0, 60.0), (4_000.0, 1_200.0))
FADES_S = 1000 * 3600

# Time over which the line's frequency is measured: pulses are too coarse for less, and the frequency changes over more.
RATE_S = 16

# Smallest distinguishable error, and steps of the histogram: four per octave.
LEAST_NS = 10.0
PER_OCTAVE = 4
BINS = 128

# Predictions with ordinary errors recompute the bound only once in this number.
RECKONED = 8


class Prediction(NamedTuple):
    """Prediction: the second that it is for, and the line that predicts its phase."""

    due_s: int
    moment_s: float
    phase_ns: float
    rate_ppb: float


def unseen_ns(ahead_s: float) -> float:
    """Return the error in ns that changes which were never observed may cause in a prediction ahead_s seconds ahead."""
    return sum(ppb * (ahead_s - follows_s * (1 - exp(-ahead_s / follows_s))) for ppb, follows_s in CHANGES)


class Horizon:
    """Predictions for one time ahead: a fading histogram of their errors, and the bound for the next."""

    def __init__(self, ahead_s: int) -> None:
        self.ahead_s = ahead_s
        self.bound_ns = 0.0
        self.every_s = max(1, ahead_s // UNDER_WAY)
        self._under_way: deque[Prediction] = deque(maxlen=UNDER_WAY)
        self._overlap = ahead_s / self.every_s  # number of overlapping predictions, whose errors are similar
        self._counts = [0.0] * BINS
        self._top = self._rare = 0  # highest bin in use, and bin of the bound
        self._total, self._forgotten_s, self._seen = 0.0, 0, 0

    def second(self, its_s: int, moment_s: float, phase_ns: float, rate_ppb: float) -> None:
        """Compare the prediction for this second with the current line, and make a new prediction."""
        under_way = self._under_way
        while under_way and under_way[0].due_s <= its_s:
            due = under_way.popleft()
            if its_s - due.due_s <= self.every_s // 2:
                foretold = due.phase_ns + due.rate_ppb * (moment_s - due.moment_s)
                self.seen(abs(phase_ns - foretold), 1.0, its_s)
        under_way.append(Prediction(its_s + self.ahead_s, moment_s, phase_ns, rate_ppb))

    def seen(self, error_ns: float, weight: float, its_s: int) -> None:
        """Count the error of a prediction."""
        self._forget(its_s)
        bin_ = min(BINS - 1, int(PER_OCTAVE * log2(max(error_ns, LEAST_NS) / LEAST_NS)))
        self._counts[bin_] += weight
        self._total += weight
        self._seen += 1
        self._top = max(self._top, bin_)
        if bin_ >= self._rare or self._seen % RECKONED == 0:
            self.bound_ns = self._quantile()

    def break_off(self) -> None:
        """Discard pending predictions; keep the counted errors."""
        self._under_way.clear()

    def _quantile(self) -> float:
        """Return the bound that all but RARE of the predictions keep, computed from the counted errors."""
        wanted, above, bin_ = max(RARE * self._total, 0.5), 0.0, self._top + 1
        while above < wanted and bin_ > 0:
            bin_ -= 1
            above += self._counts[bin_]
        self._rare = bin_
        worst_ns: float = LEAST_NS * 2.0 ** ((bin_ + 1) / PER_OCTAVE)
        independent = self._total / self._overlap
        raised: float = max(1.0, 1 / (RARE * max(independent, 1.0))) ** (1 / TAIL)
        return worst_ns * min(raised, RAISED)

    def _forget(self, its_s: int) -> None:
        if its_s - self._forgotten_s >= HALF_LIFE_S:
            self._forgotten_s = its_s
            self._counts = [count / 2 if count > 0.2 else 0.0 for count in self._counts]
            self._total = sum(self._counts)
            self._top = max((bin_ for bin_, count in enumerate(self._counts) if count), default=0)


class HoldoverEstimator:
    """Measures errors of the clock's own predictions, and bounds the error in holdover.

    seen_s  number of seconds with pulses so far.
    """

    def __init__(self) -> None:
        self._horizons = [Horizon(ahead_s) for ahead_s in HORIZONS_S]
        self.seen_s = 0

    def second(self, its_s: int, moment_s: float, phase_ns: float, rate_ppb: float) -> None:
        """Update with the line after a pulse; moment_s is in seconds of the raw clock."""
        self.seen_s += 1
        for horizon in self._horizons:
            if its_s % horizon.every_s == 0:
                horizon.second(its_s, moment_s, phase_ns, rate_ppb)

    @property
    def rate_ppb(self) -> float:
        """Largest error of the line's frequency, from its predictions RATE_S ahead."""
        return self._learnt_ns(RATE_S) / RATE_S

    def break_off(self) -> None:
        """Discard pending predictions, because the line continues elsewhere."""
        for horizon in self._horizons:
            horizon.break_off()

    def returned(self, its_s: int, ahead_s: float, error_ns: float) -> None:
        """Count the line's error when pulses return after ahead_s, with the weight of all predictions of a horizon."""
        horizon = self._horizons[max(0, bisect_right(HORIZONS_S, ahead_s) - 1)]
        beyond = max(1.0, ahead_s / HORIZONS_S[-1]) ** BEYOND
        horizon.seen(error_ns / beyond, horizon.ahead_s / horizon.every_s, its_s)

    def bound_ns(self, ahead_s: float) -> float:
        """Return the bound of the line's error ahead_s after its last pulse: observed errors and possible changes."""
        unseen = max(0.0, 1 - self.seen_s / FADES_S)
        return self._learnt_ns(ahead_s) + unseen * unseen_ns(ahead_s)

    def _learnt_ns(self, ahead_s: float) -> float:
        bound_ns, before_s, before_ns = 0.0, 0.0, 0.0
        for horizon in self._horizons:
            bound_ns = max(bound_ns, horizon.bound_ns)
            if ahead_s <= horizon.ahead_s:
                return before_ns + (bound_ns - before_ns) * (ahead_s - before_s) / (horizon.ahead_s - before_s)
            before_s, before_ns = horizon.ahead_s, bound_ns
        return float(bound_ns * (ahead_s / before_s) ** BEYOND)
