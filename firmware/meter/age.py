"""How old what a receiver knows is: age of information, and the gaps between receptions."""

from firmware.meter.sample import Sample


class Gaps:
    """Times between one reception and the next, in seconds."""

    __slots__ = ("gaps", "last_ns")

    def __init__(self, most: int) -> None:
        self.gaps = Sample(most)
        self.last_ns: int | None = None

    def add(self, received_ns: int) -> float | None:
        """A reception, by the receiver's clock. Returns its gap; None of the first one, and of one told of too late."""
        gap_s = None
        if self.last_ns is not None:
            if received_ns < self.last_ns:
                return None
            gap_s = (received_ns - self.last_ns) / 1e9
            self.gaps.add(gap_s)
        self.last_ns = received_ns
        return gap_s


class Age:
    """Age of information of one source: now less when the freshest that was received was made.

    It grows second by second, and falls with each fresher message to what that one was under way. Its mean is that
    over time; a peak is what it had come to when it fell (Yates et al., Age of Information: An Introduction and
    Survey, IEEE JSAC 39/5, 2021).
    """

    __slots__ = ("_area_s2", "_freshest_ns", "_since_ns", "_until_ns", "peaks")

    def __init__(self, most: int) -> None:
        self.peaks = Sample(most)
        self._area_s2 = 0.0
        self._freshest_ns: int | None = None
        self._since_ns = self._until_ns = 0

    def add(self, received_ns: int, delay_ns: int) -> None:
        """A reception, by the receiver's clock, of what was made so long before."""
        made_ns = received_ns - delay_ns
        if self._freshest_ns is None:
            self._freshest_ns = made_ns
            self._since_ns = self._until_ns = received_ns
            return
        if made_ns <= self._freshest_ns or received_ns < self._until_ns:
            return
        elapsed_s, age_s = (received_ns - self._until_ns) / 1e9, (self._until_ns - self._freshest_ns) / 1e9
        self._area_s2 += elapsed_s * (age_s + elapsed_s / 2)
        self.peaks.add(age_s + elapsed_s)
        self._freshest_ns, self._until_ns = made_ns, received_ns

    def mean_s(self, open_s: float = 0.0) -> float | None:
        """Over the time from the first reception to so long after the last; None where that is none."""
        elapsed_s = (self._until_ns - self._since_ns) / 1e9 + open_s
        age_s = self.last_s
        if elapsed_s <= 0 or age_s is None:
            return None
        return (self._area_s2 + open_s * (age_s + open_s / 2)) / elapsed_s

    @property
    def last_s(self) -> float | None:
        """At the last reception of something fresher."""
        return None if self._freshest_ns is None else (self._until_ns - self._freshest_ns) / 1e9
