"""Which pulses to believe: an interrupt that has to wait stamps its pulse late, and none stamps it early."""

# Beyond so many times the mean deviation a pulse is put aside: 3 and 6 standard deviations of white noise. What is
# early is no waiting interrupt: it is the truth more often than not.
LATE, EARLY = 3.8, 7.5

# So many pulses put aside one after the other are no accident: the oscillator has turned, and the least late of them is
# believed. Beside heavy work one interrupt in seven waits: four in a row are one in 2400.
RUN = 4

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

    @property
    def deviation_ns(self) -> float:
        """Standard deviation, were it white noise."""
        return 1.25 * self.mean_ns

    def believed_ns(self, late_ns: float) -> float | None:
        """How late to take a pulse for that seems so late; None if it is put aside."""
        limit_ns = LATE if late_ns > 0 else EARLY
        mean_ns = self.mean_ns
        self.mean_ns = max(LEAST_NS, mean_ns + (min(abs(late_ns), CAPPED * mean_ns) - mean_ns) / REMEMBERED)
        if abs(late_ns) > limit_ns * mean_ns:
            self._run.append(late_ns)
            late_ns = min(self._run, key=abs)
            if len(self._run) < RUN:
                self.doubt_ns = abs(late_ns) if len(self._run) > 1 else 0.0
                return None
        self._run.clear()
        self.doubt_ns = 0.0
        return late_ns
