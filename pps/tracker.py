"""A straight line through noisy readings that bends: one with a memory, and several among which the readings choose.

Each is an alpha-beta filter with the gains of a least-squares line through its last readings (Kalata; Bar-Shalom, Li,
Kirubarajan: Estimation with Applications to Tracking and Navigation, chapter 6): they grow from the first reading on up
to its memory. A long memory is quiet, a short one follows a clock that wanders. Which is better here and now shows in
how far off each foretold the reading that came.
"""

from collections import deque

# Readings that a line remembers. Below 8 an interrupt's jitter is all there is to see; beyond 512 no uncompensated
# crystal holds its frequency well enough to gain.
MEMORIES = (8, 16, 32, 64, 128, 256, 512)

# The longest memory whose squared error is within this factor of the least is taken: between neighbours there is less
# than that in white noise.
TOLERANCE = 1.06

# Errors are remembered for so many readings when memories are compared.
COMPARED = 40

# Lateness that wanders, by 50 us within ten seconds in a virtual machine, looks like a clock that turns to one who
# foretells the next reading alone: a short memory follows it, and its rate is wrong by 6 ppm. Which rate is right shows
# so many readings ahead; such errors overlap, and are remembered for longer.
AHEAD = 12
STEADY = 64


class Tracker:
    """A line: `phase` at the last reading, and `rate`, its change per second.

    memory  readings that it remembers when it has seen so many. cost: mean square of how far off it foretold.
    """

    __slots__ = ("alpha", "beta", "cost", "count", "memory", "phase", "rate")

    def __init__(self, memory: int) -> None:
        self.memory = memory
        self.begin(0.0, 0.0, 0)

    def begin(self, phase: float, rate: float, count: int) -> None:
        """Start anew from a line that stands for so many readings."""
        self.phase, self.rate, self.count, self.cost = phase, rate, 0, 0.0
        self._learn(min(count, self.memory))

    def reading(self, elapsed_s: float, value: float) -> None:
        """Take the reading of so many seconds after the last one."""
        error = value - self.phase - self.rate * elapsed_s
        if self.count < self.memory:
            self._learn(self.count + 1)
        self.phase = value - error * (1 - self.alpha)
        self.rate += self.beta * error / elapsed_s
        self.cost += (error * error - self.cost) / COMPARED

    def _learn(self, count: int) -> None:
        self.count = count
        n = max(count, 1)
        self.alpha = 2 * (2 * n - 1) / (n * (n + 1))
        self.beta = 6 / (n * (n + 1)) if n > 1 else 0.0


class Trackers:
    """Lines of several memories over the same readings.

    best    the one to believe where the clock is. steady: and how fast it runs.
    """

    def __init__(self) -> None:
        self.lines = [Tracker(memory) for memory in MEMORIES]
        self.best = self.steady = self.lines[0]
        self._now_s = 0.0
        self._before: deque[tuple[float, float, list[float]]] = deque(maxlen=AHEAD)  # when, best phase, all rates
        self._costs = [0.0] * len(MEMORIES)  # as Tracker.cost, of what was foretold AHEAD

    @property
    def count(self) -> int:
        """Readings since they began, up to the longest memory."""
        return self.lines[-1].count

    def begin(self, phase: float, rate: float, count: int, cost: float) -> None:
        """Start anew from a line that stands for so many readings, which are off it by so much squared."""
        for line in self.lines:
            line.begin(phase, rate, count)
            line.cost = cost
        self.best = self.steady = self.lines[0]
        self._before.clear()
        self._costs = [cost] * len(MEMORIES)

    def reading(self, elapsed_s: float, value: float) -> None:
        """Take a reading of so many seconds after the last one."""
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
        """Compare the rates of long ago by this reading, and choose among those of now."""
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
