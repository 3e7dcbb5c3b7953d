"""Learning of predictions, from lines with known errors."""

from itertools import accumulate
from random import Random

import pytest

from pps.holdover import BEYOND, FADES_S, HORIZONS_S, RAISED, HoldoverEstimator, unseen_ns
from tests.pps.station import START_S


def learnt(phases_ns: list[float], missing: frozenset[int] = frozenset()) -> HoldoverEstimator:
    """From a line that is always taken for level: the error of a prediction is what the phase has changed by."""
    holdover = HoldoverEstimator()
    for second, phase_ns in enumerate(phases_ns):
        if second not in missing:
            holdover.second(START_S + second, float(second), phase_ns, 0.0)
    return holdover


def walk(seconds: int, seed: int = 1) -> list[float]:
    random = Random(seed)
    return list(accumulate(random.gauss(0, 100) for _ in range(seconds)))


def learnt_ns(holdover: HoldoverEstimator, ahead_s: float) -> float:
    """The bound less what has not been seen."""
    return holdover.bound_ns(ahead_s) - unseen_ns(ahead_s) * (1 - holdover.seen_s / FADES_S)


def test_before_anything_is_known_the_bound_is_what_may_happen():
    assert HoldoverEstimator().bound_ns(0) == 0
    assert HoldoverEstimator().bound_ns(10) == unseen_ns(10) == pytest.approx(2_530, rel=0.05)
    assert HoldoverEstimator().bound_ns(3600) == unseen_ns(3600) == pytest.approx(20_459_000, rel=0.001)


def test_often_seen_errors_give_their_rare_quantile():
    # A walk of 100 ns per root second: 99.9 % of its changes within 16 s are below 3.29 x 400 ns.
    holdover = learnt(walk(40_000))
    for ahead_s in (1, 4, 16):
        assert learnt_ns(holdover, ahead_s) == pytest.approx(329 * ahead_s**0.5, rel=0.3)


def test_seldom_seen_errors_are_raised():
    phases_ns = walk(10_000)
    worst_ns = max(abs(b - a) for a, b in zip(phases_ns, phases_ns[2048:], strict=False))
    assert learnt_ns(learnt(phases_ns), 2048) > 2 * worst_ns


def test_a_line_that_foretells_all_leaves_what_may_happen():
    holdover = learnt([0.0] * 10_000)
    assert learnt_ns(holdover, 1) < 20
    assert learnt_ns(holdover, 4096) < 200


def test_what_was_not_seen_fades_from_the_bound_within_a_thousand_hours():
    holdover = learnt([0.0] * 36_000)  # ten of them
    assert holdover.bound_ns(3600) == pytest.approx(0.99 * unseen_ns(3600), rel=0.001)


def test_missing_seconds_are_no_errors():
    missing = frozenset(range(2_000, 9_000, 7)) | frozenset(range(5_000, 5_600))
    whole, holed = learnt(walk(10_000)), learnt(walk(10_000), missing)
    assert learnt_ns(holed, 16) == pytest.approx(learnt_ns(whole, 16), rel=0.3)


def test_beyond_the_longest_horizon_it_grows_by_its_law():
    holdover = learnt(walk(20_000))
    assert learnt_ns(holdover, 4 * HORIZONS_S[-1]) == pytest.approx(4**BEYOND * learnt_ns(holdover, HORIZONS_S[-1]))


def test_it_never_shrinks_with_the_time_ahead():
    holdover = learnt(walk(20_000))
    bounds = [holdover.bound_ns(ahead_s / 2) for ahead_s in range(20_000)]
    assert bounds == sorted(bounds)


def test_what_a_silence_has_shown_counts():
    holdover = learnt(walk(5_000))
    before_ns = holdover.bound_ns(1024)
    holdover.returned(START_S + 8_000, 1_100, 5_000_000.0)
    assert holdover.bound_ns(1024) > max(before_ns, 5_000_000)


def test_a_silence_beyond_the_longest_horizon_counts_by_the_law():
    holdover = HoldoverEstimator()
    holdover.returned(START_S, 4 * 4096, 8_000_000.0)
    assert holdover.bound_ns(4 * 4096) > 8_000_000
    assert learnt_ns(holdover, 4096) == pytest.approx(1_000_000 * RAISED, rel=0.2)  # once in a thousand
