"""Account of a day beside the truth, with its goals."""

from array import array
from collections import Counter
from dataclasses import dataclass, field
from statistics import median, quantiles

from board.time.scales import Lock
from pps.refused import Why
from tests.proof.chaos.run import Goal

RECOVERY_S = 5
INSIDE = 0.999
WIDE = 5.0

HOLDOVER = "without pulses"
PULSES = "with pulses"

WHOSE = {
    Lock.SYSTEM: "the system's word",
    Lock.COARSE: "messages",
    Lock.SETTLING: "pulses",
    Lock.LOCKED: "pulses",
    Lock.HOLDOVER: "pulses",
}


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
        return quantiles(self.errors, n=20)[-1] if len(self.errors) > 1 else 0.0

    @property
    def usual_bound_ns(self) -> float:
        return median(self.bounds) if self.bounds else 0.0

    @property
    def ratio(self) -> float:
        return self.usual_bound_ns / self.usual_error_ns if self.usual_error_ns else 0.0


@dataclass
class Account:
    """Of one day, or of several.

    passed, wrong  seconds passed on, and those of them that were not the true one.
    false          of those passed on, edges that were not the receiver's. off_ns: the most that one was off its second.
    refused_good   good pulses that were not passed on, RECOVERY_S and more after the trouble before them.
    back_s         the longest from the first good second after trouble to the first that was passed on.
    known          samples of the estimate: with pulses, and without any of late. blind: moments without an estimate.
    told           samples of the quality of the system's clock, by whose word it was.
    fed            samples that chronyd would have been sent amid steps of its clock; misled: those of another setting.
    acquired       series that have begun.
    """

    passed: int = 0
    wrong: int = 0
    false: int = 0
    off_ns: int = 0
    refused_good: int = 0
    back_s: int = 0
    known: dict[str, Samples] = field(default_factory=lambda: {PULSES: Samples(), HOLDOVER: Samples()})
    blind: int = 0
    told: dict[str, Samples] = field(default_factory=lambda: {whose: Samples() for whose in WHOSE.values()})
    fed: int = 0
    misled: int = 0
    acquired: int = 0
    refused: Counter[Why] = field(default_factory=Counter)

    def add(self, other: "Account") -> None:
        """Take another day in."""
        self.off_ns = max(self.off_ns, other.off_ns)
        self.back_s = max(self.back_s, other.back_s)
        for name in ("passed", "wrong", "false", "refused_good", "blind", "fed", "misled", "acquired"):
            setattr(self, name, getattr(self, name) + getattr(other, name))
        for name, samples in self.known.items():
            samples.extend(other.known[name])
        for whose, samples in self.told.items():
            samples.extend(other.told[whose])
        self.refused += other.refused

    @property
    def all(self) -> Samples:
        """With pulses and without."""
        found = Samples()
        for samples in self.known.values():
            found.extend(samples)
        return found

    def goals(self) -> list[Goal]:
        """What has to hold of all days together.

        The ratio is that of the time with pulses as well, for what there is without them is wide; and of many boards:
        a bound has to cover a lateness that no pulse shows, and a board that is late by the very middle of it has
        hardly an error.
        """
        ratio, followed = self.all.ratio, self.known[PULSES].ratio
        return [
            *self.goals_of_day(),
            Goal(
                f"median bound at most {WIDE:.0f} x the 95th percentile of the error",
                f"{ratio:.2f}; with pulses {followed:.2f}",
                ratio <= WIDE and followed <= WIDE,
            ),
        ]

    def goals_of_day(self) -> list[Goal]:
        """What has to hold of each."""
        known = self.all
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
            *(
                Goal(
                    f"truth inside the quality of the system's clock, by {whose}: {INSIDE:.1%}",
                    f"{told.inside_share:.3%} of {len(told.errors)}",
                    told.inside_share >= INSIDE,
                )
                for whose, told in self.told.items()
                if told.errors
            ),
            Goal("samples for chronyd of a clock that was stepped since: none", str(self.misled), self.misled == 0),
        ]
