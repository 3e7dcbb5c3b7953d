"""Allan deviation: frequency stability of a clock for each averaging time."""

from collections.abc import Sequence
from math import sqrt


def allan_deviation(phases_ns: Sequence[float], tau0_s: float = 1.0) -> list[tuple[float, float]]:
    """Return the overlapping Allan deviation, dimensionless, at 1, 2, 4, 8 ... times tau0_s.

    phases_ns  clock minus truth, ns, at intervals of tau0_s. The caller has filled or cut gaps.

    Returns (tau_s, deviation) up to a quarter of the length, so that the last value rests on more than two spans. The
    list is empty for fewer than 5 phases. Source: IEEE 1139-2008, clause A.2 (overlapping estimator); NIST SP 1065,
    5.2.4.
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
