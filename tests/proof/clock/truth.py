"""True time of the host, on the guest's clocks.

The guest's oscillator is the host's CLOCK_MONOTONIC: QEMU counts its virtual clock by it. So the truth is made wrong
instead of the oscillator. For 40 ppm, a second of it is 40 us longer on the host's clock. The guest cannot notice.
"""

import time
from typing import NamedTuple

S = 1_000_000_000
EPOCH = 1_072_915_200  # Unix time of 2004-01-01T00:00:00Z, when ITS time begins
LEAPS = 5  # seconds between then and 2017-01-01; the last one until this was written


def host_ns() -> int:
    """The clock that QEMU counts by."""
    return time.clock_gettime_ns(time.CLOCK_MONOTONIC)


class Truth:
    """ITS time by the host's clock.

    its_s      of its beginning, which is when start() is called: until then it stands still.
    fast_ppb   by which oscillators, the host's and so the guest's, run fast against it.
    leap_its_s  ITS time of the leap second 23:59:60 that it steps through; None: there is none.
    leaps      leap seconds since 2004, before that one.
    """

    def __init__(self, its_s: int, fast_ppb: int = 0, leap_its_s: int | None = None, leaps: int = LEAPS) -> None:
        self.its_s = its_s
        self.fast_ppb = fast_ppb
        self.leap_its_s = leap_its_s
        self.leaps = leaps
        self._began_ns: int | None = None

    def start(self) -> None:
        self._began_ns = host_ns()

    def clock(self) -> float:
        """True seconds since the beginning: a loop's clock."""
        return 0.0 if self._began_ns is None else (self.its_ns(host_ns()) - self.its_s * S) / S

    def its_ns(self, at_ns: int) -> int:
        """ITS time of a moment of the host's clock."""
        assert self._began_ns is not None
        gone_ns = at_ns - self._began_ns
        return self.its_s * S + gone_ns * S // (S + self.fast_ppb)

    def unix_ns(self, its_ns: int) -> int:
        """Unix time of ITS time, as a kernel counts it: the second before a leap second comes twice."""
        has_leapt = self.leap_its_s is not None and its_ns >= self.leap_its_s * S
        return its_ns + (EPOCH - self.leaps - has_leapt) * S

    def host_ns(self, its_ns: int) -> int:
        """The inverse of its_ns()."""
        assert self._began_ns is not None
        gone_ns = its_ns - self.its_s * S
        return self._began_ns + gone_ns * (S + self.fast_ppb) // S


class Span(NamedTuple):
    """Where a moment lies: no earlier and no later than these, ns."""

    earliest: int
    latest: int

    @property
    def middle(self) -> int:
        return (self.earliest + self.latest) // 2

    @property
    def half(self) -> int:
        return (self.latest - self.earliest + 1) // 2


class Ruler:
    """Lays the guest's CLOCK_MONOTONIC_RAW on the host's clock: they differ by one number for as long as it runs.

    Each exchange bounds that number, by cause and effect alone: all exchanges together bound it better than any. Were
    the two clocks not one, the bounds would soon contradict each other: is_sound says that they never did.
    """

    def __init__(self) -> None:
        self._least: int | None = None
        self._most: int | None = None
        self.is_sound = True

    def after(self, at_ns: int, raw_ns: int) -> None:
        """The guest read raw_ns after the host's at_ns."""
        self._least = at_ns - raw_ns if self._least is None else max(self._least, at_ns - raw_ns)
        self._check()

    def before(self, at_ns: int, raw_ns: int) -> None:
        """The guest read raw_ns before the host's at_ns."""
        self._most = at_ns - raw_ns if self._most is None else min(self._most, at_ns - raw_ns)
        self._check()

    def host(self, raw_ns: int) -> Span:
        """The host's clock at a moment of the guest's."""
        assert self._least is not None
        assert self._most is not None
        return Span(raw_ns + self._least, raw_ns + self._most)

    def _check(self) -> None:
        if self._least is not None and self._most is not None:
            self.is_sound &= self._least <= self._most
