"""Allan deviation: how much a clock's frequency changes between neighbouring spans of a length, for all lengths."""

from collections.abc import Sequence
from math import sqrt


def allan_deviation(phases_ns: Sequence[float], tau0_s: float = 1.0) -> list[tuple[float, float]]:
    """Overlapping Allan deviation, dimensionless, at tau0_s, 2, 4, 8 ... times it.

    phases_ns  clock less truth, ns, each tau0_s. A gap has to be filled or cut before.

    Returns (tau_s, deviation) up to a quarter of the length, so that the last of them rests on more than two spans;
    nothing for fewer than 5 phases. Source: IEEE 1139-2008, clause A.2 (overlapping estimator); NIST SP 1065, 5.2.4.
    """
    deviations = []
    spans = 1
    while 4 * spans < len(phases_ns):
        after, later = phases_ns[spans:], phases_ns[2 * spans :]
        squares = [c - b - b + a for a, b, c in zip(phases_ns, after, later, strict=False)]
        tau_s = spans * tau0_s
        variance = sum(map(float.__mul__, squares, squares)) / (2 * len(squares))
        deviations.append((tau_s, sqrt(variance) * 1e-9 / tau_s))
        spans *= 2
    return deviations
