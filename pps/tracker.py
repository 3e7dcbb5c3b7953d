"""Adaptive line through noisy readings: filters of several memories, and a selector.

Each is an alpha-beta filter with the gains of a least-squares line through its last readings. Source: Kalata;
Bar-Shalom, Li, Kirubarajan: Estimation with Applications to Tracking and Navigation, chapter 6. The gains fall from
the first reading up to the memory. A long memory is quiet; a short one follows a wandering clock. The prediction error
of each selects the better one.
"""

from collections import deque

# Numbers of readings that the lines remember. Less than 8 would follow the jitter of interrupts; beyond 512, no
# uncompensated crystal holds its frequency well enough.
MEMORIES = (8, 16, 32, 64, 128, 256, 512)

# The longest memory whose squared error is within this factor of the least is selected. With white noise, neighbours
# differ by less.
TOLERANCE = 1.06

# Number of readings over which errors are averaged to compare memories.
COMPARED = 40

# Wandering lateness, such as 50 us within ten seconds in a virtual machine, resembles a drifting clock if only the next
# reading is predicted. A short memory follows it, and its rate is wrong by 6 ppm. So rates are judged by predictions
# AHEAD readings ahead. Such errors overlap, and are averaged over STEADY readings.
AHEAD = 12
STEADY = 64


class Tracker:
    """Line: `phase` at the last reading, and `rate`, its change per second.

    memory  number of readings that it remembers at most.
    cost    mean square of its prediction errors.
    """

    __slots__ = ("alpha", "beta", "cost", "count", "memory", "phase", "rate")

    def __init__(self, memory: int) -> None:
        self.memory = memory
        self.count = 0
        self.phase = self.rate = self.cost = 0.0
        self.alpha, self.beta = _gains(0)

    def begin(self, phase: float, rate: float, count: int) -> None:
        """Start again from a line that rests on `count` readings."""
        self.phase, self.rate, self.cost = phase, rate, 0.0
        self._learn(min(count, self.memory))

    def reading(self, elapsed_s: float, value: float) -> None:
        """Add a reading that came elapsed_s after the previous one."""
        error = value - self.phase - self.rate * elapsed_s
        if self.count < self.memory:
            self._learn(self.count + 1)
        self.phase = value - error * (1 - self.alpha)
        self.rate += self.beta * error / elapsed_s
        self.cost += (error * error - self.cost) / COMPARED

    def _learn(self, count: int) -> None:
        self.count = count
        self.alpha, self.beta = _gains(count)


def _gains(count: int) -> tuple[float, float]:
    """Return alpha and beta of a least-squares line through `count` readings; the first reading is taken as it is."""
    n = max(count, 1)
    return 2 * (2 * n - 1) / (n * (n + 1)), 6 / (n * (n + 1)) if n > 1 else 0.0


class Trackers:
    """Lines of several memories over the same readings.

    best    line that predicts the phase best.
    steady  line whose rate is best.
    """

    def __init__(self) -> None:
        self.lines = [Tracker(memory) for memory in MEMORIES]
        self.best = self.steady = self.lines[0]
        self._now_s = 0.0
        self._before: deque[tuple[float, float, list[float]]] = deque(maxlen=AHEAD)  # time, best phase, all rates
        self._costs = [0.0] * len(MEMORIES)  # like Tracker.cost, for predictions AHEAD readings ahead

    @property
    def count(self) -> int:
        """Number of readings since begin(), up to the longest memory."""
        return self.lines[-1].count

    def begin(self, phase: float, rate: float, count: int, cost: float) -> None:
        """Start again from a line that rests on `count` readings with a mean square error of `cost`."""
        for line in self.lines:
            line.begin(phase, rate, count)
            line.cost = cost
        self.best = self.steady = self.lines[0]
        self._before.clear()
        self._costs = [cost] * len(MEMORIES)

    def reading(self, elapsed_s: float, value: float) -> None:
        """Add a reading that came elapsed_s after the previous one."""
        least = float("inf")
        for line in self.lines:
            line.reading(elapsed_s, value)
            least = min(line.cost, least)
        limit = least * TOLERANCE
        for line in self.lines:
            if line.cost <= limit:
                self.best = line
        self._foretell(elapsed_s, value)

    def _foretell(self, elapsed_s: float, value: float) -> None:
        """Judge earlier rates by this reading, and select the line with the best rate."""
        self._now_s += elapsed_s
        before, costs = self._before, self._costs
        if len(before) < AHEAD:
            self.steady = self.best
        else:
            then_s, phase, rates = before[0]
            ahead_s = self._now_s - then_s
            for number, rate in enumerate(rates):
                error = value - phase - rate * ahead_s
                costs[number] += (error * error - costs[number]) / STEADY
            limit = min(costs) * TOLERANCE
            self.steady = next(line for line, cost in zip(self.lines[::-1], costs[::-1], strict=True) if cost <= limit)
        before.append((self._now_s, self.best.phase, [line.rate for line in self.lines]))
