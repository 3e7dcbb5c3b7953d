"""How far off a clock's predictions are, learnt from those that have come due, and how far off they may be at worst."""

from bisect import bisect_right
from collections import deque
from math import exp, log2
from typing import NamedTuple

# Seconds ahead that predictions are made for. Between two the bound is a straight line; beyond the last it grows as
# the power below: a random walk of the frequency, the steepest of the usual noises of oscillators (IEEE 1139).
HORIZONS_S = tuple(1 << octave for octave in range(13))
BEYOND = 1.5

# Predictions that are under way for one horizon: so many are made within its time.
UNDER_WAY = 8

# The share of predictions that may be further off than the bound. Where fewer than 1 / RARE have been seen, the worst
# of them is raised by the law of a tail that falls with this power: heavier than noise, as changes of temperature are.
RARE = 0.001
TAIL = 3.0
# By no more than this: what nothing has shown yet is stated beside it, below.
RAISED = 3.0

# What was seen counts half after so long: summer is not winter.
HALF_LIFE_S = 14 * 86400

# What may happen though it never has, just after the last pulse: ppb, and seconds by which the crystal follows. It is
# an AT cut, of 0.2 to 0.4 ppm/K. A fan stops, and the air in the box is 10 K warmer at once; an engine is started, and
# it is 15 K warmer after half an hour. (NTP takes 15 ppm for any clock: RFC 5905, PHI.) The second row, its 20 minutes
# above all, was widened until random days of tests/pps/days were inside, and has no other source. A quiet day is no
# promise against it. After 1000 hours of pulses without it, it is rarer in the next hour than RARE, and what was seen
# is all that is stated; until then it fades.
CHANGES = ((3_000.0, 60.0), (4_000.0, 1_200.0))
FADES_S = 1000 * 3600

# Over so long the line's frequency shows: pulses are too coarse before, and it is another after.
RATE_S = 16

# The finest error that is told from none, and steps of the histogram: four per octave.
LEAST_NS = 10.0
PER_OCTAVE = 4
BINS = 128

# Of predictions that change nothing about the rare ones, every so manieth has the bound reckoned anew.
RECKONED = 8


class Prediction(NamedTuple):
    """What was foretold: for which second, and the line that says it."""

    due_s: int
    moment_s: float
    phase_ns: float
    rate_ppb: float


def unseen_ns(ahead_s: float) -> float:
    """How far off a prediction so far ahead may be by what has never been seen."""
    return sum(ppb * (ahead_s - follows_s * (1 - exp(-ahead_s / follows_s))) for ppb, follows_s in CHANGES)


class Horizon:
    """Predictions of one time ahead: a histogram of their errors that forgets, and what it says of the next."""

    def __init__(self, ahead_s: int) -> None:
        self.ahead_s = ahead_s
        self.bound_ns = 0.0
        self.every_s = max(1, ahead_s // UNDER_WAY)
        self._under_way: deque[Prediction] = deque(maxlen=UNDER_WAY)
        self._overlap = ahead_s / self.every_s  # neighbours of one time ahead say much the same
        self._counts = [0.0] * BINS
        self._top = self._rare = 0  # the highest bin with any, and that of the bound
        self._total, self._forgotten_s, self._seen = 0.0, 0, 0

    def second(self, its_s: int, moment_s: float, phase_ns: float, rate_ppb: float) -> None:
        """Compare what was foretold for this second with the line of now, and foretell another."""
        under_way = self._under_way
        while under_way and under_way[0].due_s <= its_s:
            due = under_way.popleft()
            if its_s - due.due_s <= self.every_s // 2:
                foretold = due.phase_ns + due.rate_ppb * (moment_s - due.moment_s)
                self.seen(abs(phase_ns - foretold), 1.0, its_s)
        under_way.append(Prediction(its_s + self.ahead_s, moment_s, phase_ns, rate_ppb))

    def seen(self, error_ns: float, weight: float, its_s: int) -> None:
        """A prediction of this time ahead was so far off."""
        self._forget(its_s)
        bin_ = min(BINS - 1, int(PER_OCTAVE * log2(max(error_ns, LEAST_NS) / LEAST_NS)))
        self._counts[bin_] += weight
        self._total += weight
        self._seen += 1
        self._top = max(self._top, bin_)
        if bin_ >= self._rare or self._seen % RECKONED == 0:
            self.bound_ns = self._quantile()

    def break_off(self) -> None:
        """Forget what is foretold, and keep what was learnt."""
        self._under_way.clear()

    def _quantile(self) -> float:
        """What all but RARE of the predictions are within, by those seen."""
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


class Foresight:
    """What the estimator has learnt of its own predictions.

    seen_s  seconds with pulses so far.
    """

    def __init__(self) -> None:
        self._horizons = [Horizon(ahead_s) for ahead_s in HORIZONS_S]
        self.seen_s = 0

    def second(self, its_s: int, moment_s: float, phase_ns: float, rate_ppb: float) -> None:
        """The line as it is after a pulse: at a moment of the raw clock, in seconds."""
        self.seen_s += 1
        for horizon in self._horizons:
            if its_s % horizon.every_s == 0:
                horizon.second(its_s, moment_s, phase_ns, rate_ppb)

    @property
    def rate_ppb(self) -> float:
        """How far off the frequency of the line is at worst, by what it foretold for the next RATE_S."""
        return self._learnt_ns(RATE_S) / RATE_S

    def break_off(self) -> None:
        """The line goes on elsewhere: what it foretold of seconds to come says nothing any more."""
        for horizon in self._horizons:
            horizon.break_off()

    def returned(self, its_s: int, ahead_s: float, error_ns: float) -> None:
        """Pulses came again so long after the last, and the line was so far off: as many of one horizon as fit."""
        horizon = self._horizons[max(0, bisect_right(HORIZONS_S, ahead_s) - 1)]
        beyond = max(1.0, ahead_s / HORIZONS_S[-1]) ** BEYOND
        horizon.seen(error_ns / beyond, horizon.ahead_s / horizon.every_s, its_s)

    def bound_ns(self, ahead_s: float) -> float:
        """How far off the line may be, so many seconds after its last pulse, by what was learnt and may happen."""
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
