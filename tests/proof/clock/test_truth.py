"""The bench's own arithmetic: true time by the host's clock, and the guest's oscillator on it."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from board.time.scales import EPOCH as BOARDS_EPOCH
from tests.proof.clock import truth
from tests.proof.clock.truth import EPOCH, Ruler, S, Span, Truth

BEGAN_NS = 5_000_000_000


def began(monkeypatch: pytest.MonkeyPatch, made: Truth) -> Truth:
    monkeypatch.setattr(truth, "host_ns", lambda: BEGAN_NS)
    made.start()
    return made


def test_the_truth_stands_still_until_it_is_started() -> None:
    assert Truth(its_s=700).clock() == 0.0


def test_a_true_second_is_longer_on_a_clock_that_runs_fast(monkeypatch: pytest.MonkeyPatch) -> None:
    made = began(monkeypatch, Truth(its_s=700, fast_ppb=40_000))
    assert made.host_ns(701 * S) == BEGAN_NS + S + 40_000
    assert made.its_ns(BEGAN_NS + S + 40_000) == 701 * S


@given(its_ns=st.integers(700 * S, 10**6 * S), fast_ppb=st.integers(-200_000, 200_000))
def test_there_and_back_it_is_the_same_moment(its_ns: int, fast_ppb: int) -> None:
    with pytest.MonkeyPatch.context() as patched:
        made = began(patched, Truth(700, fast_ppb))
        assert abs(made.its_ns(made.host_ns(its_ns)) - its_ns) <= 1


def test_unix_time_repeats_the_second_before_a_leap_second() -> None:
    made = Truth(0, leap_its_s=410_313_604, leaps=4)
    before, leap, behind = (made.unix_ns((410_313_604 + at_s) * S) // S for at_s in (-1, 0, 1))
    assert before == leap == 1_483_228_799
    assert behind == 1_483_228_800


def test_the_epoch_is_that_of_the_station() -> None:
    assert EPOCH == BOARDS_EPOCH


def test_exchanges_bound_each_other() -> None:
    ruler = Ruler()
    ruler.after(at_ns=1_000, raw_ns=100)
    ruler.before(at_ns=1_300, raw_ns=100)
    ruler.after(at_ns=2_050, raw_ns=1_100)
    ruler.before(at_ns=2_120, raw_ns=1_100)
    assert ruler.host(2_000) == Span(2_950, 3_020)
    assert ruler.is_sound


def test_two_clocks_that_are_not_one_contradict_each_other() -> None:
    ruler = Ruler()
    ruler.after(at_ns=1_000, raw_ns=100)
    ruler.before(at_ns=1_050, raw_ns=100)
    ruler.after(at_ns=1_001_200, raw_ns=1_000_100)
    assert not ruler.is_sound
