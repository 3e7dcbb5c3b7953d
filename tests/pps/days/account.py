"""What was seen of a day beside the truth, and what has to hold of it."""

from array import array
from collections import Counter
from dataclasses import dataclass, field
from statistics import median, quantiles

from board.time import Lock
from pps.refused import Why
from tests.chaos.run import Goal

RECOVERY_S = 5
INSIDE = 0.999
WIDE = 5.0

HOLDOVER = "without pulses"
PULSES = "with pulses"


class Samples:
    """Estimates beside the truth. errors, bounds: ns. inside: of how many the truth was within the bound."""

    def __init__(self) -> None:
        self.errors, self.bounds = array("q"), array("q")
        self.inside = 0

    def add(self, error_ns: int, bound_ns: int) -> None:
        error_ns = abs(error_ns)
        self.errors.append(error_ns)
        self.bounds.append(bound_ns)
        self.inside += error_ns <= bound_ns

    def extend(self, other: "Samples") -> None:
        self.errors.extend(other.errors)
        self.bounds.extend(other.bounds)
        self.inside += other.inside

    @property
    def inside_share(self) -> float:
        return self.inside / len(self.errors) if self.errors else 1.0

    @property
    def usual_error_ns(self) -> float:
        """95 % of the true errors are smaller."""
        return quantiles(self.errors, n=20)[-1]

    @property
    def usual_bound_ns(self) -> float:
        return median(self.bounds)

    @property
    def ratio(self) -> float:
        return self.usual_bound_ns / self.usual_error_ns


@dataclass
class Account:
    """Of one day, or of several.

    passed, wrong  seconds passed on, and those of them that were not the true one.
    false          of those passed on, edges that were not the receiver's. off_ns: the most that one was off its second.
    refused_good   good pulses that were not passed on, RECOVERY_S and more after the trouble before them.
    back_s         the longest from the first good second after trouble to the first that was passed on.
    known          samples of the estimate: with pulses, and without any of late. blind: moments without an estimate.
    told           samples of the quality of the system's clock, by state. states: how many of each.
    stepped        seconds that say that the system's clock was stepped. acquired: series that have begun.
    """

    passed: int = 0
    wrong: int = 0
    false: int = 0
    off_ns: int = 0
    refused_good: int = 0
    back_s: int = 0
    known: dict[str, Samples] = field(default_factory=lambda: {PULSES: Samples(), HOLDOVER: Samples()})
    blind: int = 0
    told: Samples = field(default_factory=Samples)
    states: Counter[Lock] = field(default_factory=Counter)
    stepped: int = 0
    acquired: int = 0
    refused: Counter[Why] = field(default_factory=Counter)

    def add(self, other: "Account") -> None:
        """Take another day in."""
        self.off_ns = max(self.off_ns, other.off_ns)
        self.back_s = max(self.back_s, other.back_s)
        for name in ("passed", "wrong", "false", "refused_good", "blind", "stepped", "acquired"):
            setattr(self, name, getattr(self, name) + getattr(other, name))
        for name, samples in self.known.items():
            samples.extend(other.known[name])
        self.told.extend(other.told)
        self.refused += other.refused
        self.states += other.states

    @property
    def all(self) -> Samples:
        """With pulses and without."""
        found = Samples()
        for samples in self.known.values():
            found.extend(samples)
        return found

    def goals(self) -> list[Goal]:
        """The four statements, the fourth of the time with pulses as well: what there is without them is wide."""
        known, told = self.all, self.told
        ratio, followed = known.ratio, self.known[PULSES].ratio
        return [
            Goal("wrong seconds passed on: none", str(self.wrong), self.wrong == 0),
            Goal(
                f"good pulses refused {RECOVERY_S} s after recovery: none",
                f"{self.refused_good}; {self.back_s} s",
                self.refused_good == 0 and self.back_s <= RECOVERY_S,
            ),
            Goal(
                f"truth inside the stated bound: {INSIDE:.1%}",
                f"{known.inside_share:.3%}",
                known.inside_share >= INSIDE,
            ),
            Goal(
                f"median bound at most {WIDE:.0f} x the 95th percentile of the error",
                f"{ratio:.2f}; with pulses {followed:.2f}",
                ratio <= WIDE and followed <= WIDE,
            ),
            Goal(
                f"truth inside the quality of the system's clock: {INSIDE:.1%}",
                f"{told.inside_share:.3%}",
                told.inside_share >= INSIDE,
            ),
        ]
