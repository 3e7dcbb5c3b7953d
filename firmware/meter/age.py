"""Age of information, and gaps between receptions."""

from firmware.meter.sample import Sample


class Gaps:
    """Times between consecutive receptions, in seconds."""

    __slots__ = ("gaps", "last_ns")

    def __init__(self, most: int) -> None:
        self.gaps = Sample(most)
        self.last_ns: int | None = None

    def add(self, received_ns: int) -> float | None:
        """Add a reception; received_ns: Unix time in nanoseconds by the receiver's clock.

        Returns the gap since the previous reception in seconds; None for the first one, and for one reported out of
        order.
        """
        gap_s = None
        if self.last_ns is not None:
            if received_ns < self.last_ns:
                return None
            gap_s = (received_ns - self.last_ns) / 1e9
            self.gaps.add(gap_s)
        self.last_ns = received_ns
        return gap_s


class Age:
    """Age of information of one source: the time since the freshest received message was generated.

    The age grows with time. Each fresher message reduces it to that message's own delay. The mean is over time; a peak
    is the age just before such a reduction (Yates et al., Age of Information: An Introduction and Survey, IEEE JSAC
    39/5, 2021).
    """

    __slots__ = ("_area_s2", "_freshest_ns", "_since_ns", "_until_ns", "peaks")

    def __init__(self, most: int) -> None:
        self.peaks = Sample(most)
        self._area_s2 = 0.0
        self._freshest_ns: int | None = None
        self._since_ns = self._until_ns = 0

    def add(self, received_ns: int, delay_ns: int) -> None:
        """Add a message received at a time of the receiver's clock and generated delay_ns earlier."""
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
        """Return the mean age in seconds; None if no time has passed.

        open_s  seconds after the last reception that are included.
        """
        elapsed_s = (self._until_ns - self._since_ns) / 1e9 + open_s
        age_s = self.last_s
        if elapsed_s <= 0 or age_s is None:
            return None
        return (self._area_s2 + open_s * (age_s + open_s / 2)) / elapsed_s

    @property
    def last_s(self) -> float | None:
        """Age in seconds at the last reception of a fresher message; None before the first."""
        return None if self._freshest_ns is None else (self._until_ns - self._freshest_ns) / 1e9
