"""A station of which all is simulated but its idea of the time: crystal, air, interrupts, pulses; the truth is known."""

from collections.abc import Iterable, Sequence
from itertools import pairwise
from statistics import median, quantiles
from typing import NamedTuple

from pps.chain import SECOND_NS
from pps.quality import Estimator
from pps.sim.interrupts import Edges, Interrupts
from pps.sim.machine import Machine
from pps.sim.oscillator import START_NS, Crystal, Oscillator, drawn
from pps.sim.temperature import Temperature
from pps.timemark import Pairing, Second
from tests.pps.days.words import Leaping, Words

START_S = START_NS // SECOND_NS
LEAP_SECONDS = 18
WORDS = Words(Leaping(LEAP_SECONDS))


class Sample(NamedTuple):
    """An estimate beside the truth. second: since the start."""

    second: float
    error_ns: int
    uncertainty_ns: int


class Station:
    """A machine with a receiver. Seconds count from the start of the simulation."""

    def __init__(
        self,
        seed: int,
        *,
        crystal: Crystal | None = None,
        air: Temperature | None = None,
        base_ns: float | None = None,
        loads: Sequence[tuple[float, float]] = (),
        system_error_ns: int = 0,
        latency_ns: int = 10_000,
    ) -> None:
        self.oscillator = Oscillator(crystal or drawn(seed), air or Temperature(), seed)
        self.machine = Machine(self.oscillator, system_error_ns)
        self.edges = Edges(self.machine, Interrupts(seed + 1, base_ns, loads), seed + 2)
        self.estimator = Estimator(latency_ns)
        self.pairing = Pairing()

    def pulse(self, second: int, late_ns: int = 0, label_s: int | None = None, series: int = 1) -> None:
        """A pulse comes, and is known to be of its second; late_ns: beyond what interrupts are late."""
        pulse = self.edges.edge(START_NS + second * SECOND_NS + late_ns)
        its_s = START_S + (second if label_s is None else label_s)
        self.estimator.second(Second(pulse, its_s, 20, LEAP_SECONDS, None, series))

    def pulses(self, seconds: Iterable[int]) -> None:
        for second in seconds:
            self.pulse(second)

    def paired_pulse(self, second: int) -> None:
        """A pulse comes between what a receiver says before and after it."""
        its_s = START_S + second
        pulse = self.edges.edge(its_s * SECOND_NS)
        self.pairing.mark(WORDS.mark(its_s, pulse.monotonic - 0.9))
        self.pairing.pulse(pulse)
        for event in self.pairing.fix(WORDS.fix(its_s, pulse.monotonic + 0.08)):
            if isinstance(event, Second):
                self.estimator.second(event)

    def sample(self, second: float) -> Sample | None:
        """The estimate at a true time, if there is one."""
        true_ns = START_NS + round(second * SECOND_NS)
        known = self.estimator.estimate(self.oscillator.raw_ns(true_ns))
        return Sample(second, known[0] - true_ns, known[1]) if known else None

    def run(
        self, seconds: int, silences: Sequence[tuple[float, float]] = (), every_s: int = 10, begin_s: int = 2
    ) -> list[Sample]:
        """Pulses but in the silences, and samples at moments of all kinds."""
        samples = []
        for second in range(begin_s, begin_s + seconds):
            if not any(begin <= second < end for begin, end in silences):
                self.pulse(second)
            if second % every_s == 0:
                samples.append(self.sample(second + 0.15 + 0.1 * (second // every_s % 10)))
        return [sample for sample in samples if sample]


class Figures(NamedTuple):
    """covered: share of samples with the truth inside the bound. ratio: of the median bound to 95 % of the errors."""

    covered: float
    ratio: float
    bound_ns: float
    error_ns: float
    worst_ns: int

    def __str__(self) -> str:
        return (
            f"truth inside {self.covered:.3%}, median bound {self.bound_ns / 1000:.1f} us,"
            f" 95 % of errors below {self.error_ns / 1000:.1f} us, worst {self.worst_ns / 1000:.1f} us,"
            f" ratio {self.ratio:.2f}"
        )


def figures(samples: Sequence[Sample]) -> Figures:
    """What the goals are about."""
    errors = [abs(sample.error_ns) for sample in samples]
    covered = sum(abs(sample.error_ns) <= sample.uncertainty_ns for sample in samples) / len(samples)
    bound_ns, error_ns = median(sample.uncertainty_ns for sample in samples), quantiles(errors, n=20)[-1]
    return Figures(covered, bound_ns / error_ns, bound_ns, error_ns, max(errors))


def grows(samples: Sequence[Sample]) -> bool:
    """Whether the bound does, from each sample to the next."""
    return all(a.uncertainty_ns <= b.uncertainty_ns for a, b in pairwise(samples))
