"""Rejects pulses with late stamps: a delayed interrupt stamps late, never early."""

# Limits of deviation, in mean deviations: 3 and 6 standard deviations of white noise. A pulse beyond is not used. The
# limit for early pulses is wider: interrupts never come early, so an early pulse is mostly right.
LATE, EARLY = 3.8, 7.5

# If the oscillator's rate changes, the phase departs from the line slowly. So two successive pulses that exceed the
# limit by little are not accidental; neither are RUN pulses beyond it by any amount. (Under heavy load, one interrupt
# in seven waits, for about 40 us: four in a row are one in 2400.) From then on, the gate accepts small deviations, or
# deviations not much larger than the previous one, until a pulse agrees with the estimate.
LITTLE, RUN = 16.0, 4
STEEPER = 2.0

# The mean deviation covers this number of pulses, and each counts for at most CAPPED times the mean. So up to half of
# the pulses may be late, and the other half still determines the mean.
REMEMBERED = 64
CAPPED = 2.0

# Smallest mean deviation; no machine's interrupts are better.
LEAST_NS = 50.0


class Lateness:
    """Gate that puts late pulses aside.

    mean_ns   mean absolute deviation of ordinary pulses from the estimate.
    doubt_ns  error of the estimate if the pulses just put aside are right: the least of them, if there are two or more.
    """

    def __init__(self, mean_ns: float) -> None:
        self.mean_ns = max(mean_ns, LEAST_NS)
        self.doubt_ns = 0.0
        self._run: list[float] = []
        self._is_open = False
        self._before_ns = 0.0

    @property
    def deviation_ns(self) -> float:
        """Standard deviation of pulses, under the assumption of white noise."""
        return 1.25 * self.mean_ns

    def believed_ns(self, late_ns: float) -> float | None:
        """Return the lateness with which to use a pulse; None if the pulse is put aside."""
        limit_ns = LATE if late_ns > 0 else EARLY
        mean_ns = self.mean_ns
        self.mean_ns = max(LEAST_NS, mean_ns + (min(abs(late_ns), CAPPED * mean_ns) - mean_ns) / REMEMBERED)
        if abs(late_ns) <= limit_ns * mean_ns:
            self._run.clear()
            self._is_open, self.doubt_ns = False, 0.0
            return late_ns
        if self._is_open and abs(late_ns) <= LITTLE * mean_ns + STEEPER * self._before_ns:
            self._before_ns = abs(late_ns)
            return late_ns
        return self._doubted_ns(late_ns)

    def _doubted_ns(self, late_ns: float) -> float | None:
        """Put a pulse aside; or return the least late of those put aside if they are not accidental."""
        run = self._run
        run.append(late_ns)
        least_ns = min(run, key=abs)
        are_little = max(map(abs, run)) <= LITTLE * self.mean_ns
        self._is_open = len(run) >= RUN or (len(run) > 1 and are_little)
        self.doubt_ns = 0.0 if self._is_open or len(run) == 1 else abs(least_ns)
        if not self._is_open:
            return None
        run.clear()
        self._before_ns = abs(least_ns)
        return least_ns
