"""Which pulses to believe: an interrupt that has to wait stamps its pulse late, and none stamps it early."""

# Beyond so many times the mean deviation a pulse is put aside: 3 and 6 standard deviations of white noise. What is
# early is no waiting interrupt: it is the truth more often than not.
LATE, EARLY = 3.8, 7.5

# An oscillator that turns leaves its line slowly: two pulses one after the other that are put aside by little are no
# accident, and neither are four of whatever size. (Beside heavy work one interrupt in seven waits, for 40 us or so:
# four in a row are one in 2400.) From then on pulses are believed that are off by little, or by not much more than the
# one before, until one is where the estimate is.
LITTLE, RUN = 16.0, 4
STEEPER = 2.0

# The mean deviation is that of so many pulses, and none counts for more than CAPPED of it: up to half of all pulses may
# be late, and the other half still says how exact a pulse is.
REMEMBERED = 64
CAPPED = 2.0

# Nobody's interrupts are better.
LEAST_NS = 50.0


class Lateness:
    """A gate for pulses.

    mean_ns   deviation of an ordinary pulse from the estimate: its mean absolute value.
    doubt_ns  how far off the estimate is if those just put aside are right: the least of them, if there are two.
    """

    def __init__(self, mean_ns: float) -> None:
        self.mean_ns = max(mean_ns, LEAST_NS)
        self.doubt_ns = 0.0
        self._run: list[float] = []
        self._is_open = False
        self._before_ns = 0.0

    @property
    def deviation_ns(self) -> float:
        """Standard deviation, were it white noise."""
        return 1.25 * self.mean_ns

    def believed_ns(self, late_ns: float) -> float | None:
        """How late to take a pulse for that seems so late; None if it is put aside."""
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
        """Put one aside; or believe the least late of those put aside, as it is no accident any more."""
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
