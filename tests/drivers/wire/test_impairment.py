"""Impairment of frames, with a count of each effect."""

from collections.abc import Sequence
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from board.runtime.errors import ConfigurationError
from drivers.wire.impairment import Burst, Impairment, Impairments

FRAME = bytes(100)
SHARE = st.floats(0.0, 1.0)
ANY = st.builds(
    Impairments,
    loss=SHARE,
    burst=st.none() | st.builds(Burst, SHARE, SHARE, SHARE, SHARE),
    delay_s=st.floats(0.0, 1.0),
    jitter_s=st.floats(0.0, 1.0),
    reorder=SHARE,
    duplicate=SHARE,
    bit_errors=st.floats(0.0, 0.1),
    seed=st.integers(0, 1000),
)


def passed(wanted: Impairments, frames: Sequence[bytes], period: float = 0.01) -> tuple[Impairment[int], list[int]]:
    """Pass frames through an impairment. Return it, and the indexes of the frames in the order of their exit."""
    way, order = Impairment[int](wanted), list[int]()
    for number, frame in enumerate(frames):
        order += [one.about for one in way.due(number * period)]
        way.take(frame, number * period, number)
    order += [one.about for one in way.due(float("inf"))]
    return way, order


@given(wanted=ANY, count=st.integers(0, 60))
def test_every_frame_is_in_exactly_one_count(wanted: Impairments, count: int):
    way, order = passed(wanted, [FRAME] * count)
    counts = way.counts
    assert counts.taken == count
    assert counts.taken + counts.duplicated == counts.lost + counts.burst_lost + counts.overflow + counts.given
    assert counts.given == len(order)
    assert way.deadline() is None


@given(wanted=ANY, count=st.integers(0, 60))
def test_the_same_seed_gives_the_same_fate_again(wanted: Impairments, count: int):
    assert passed(wanted, [FRAME] * count)[1] == passed(wanted, [FRAME] * count)[1]


@given(wanted=ANY, delay_s=st.floats(0.0, 1.0))
def test_what_is_lost_does_not_depend_on_how_late_the_rest_comes(wanted: Impairments, delay_s: float):
    other = replace(wanted, delay_s=delay_s, jitter_s=0.5, reorder=0.0, bit_errors=0.01)
    assert sorted(passed(wanted, [FRAME] * 50)[1]) == sorted(passed(other, [FRAME] * 50)[1])


@given(wanted=ANY, count=st.integers(0, 60))
def test_only_what_is_held_back_is_overtaken(wanted: Impairments, count: int):
    way, order = passed(replace(wanted, reorder=0.0), [FRAME] * count)
    assert order == sorted(order)
    assert way.counts.overtaken == 0


@given(wanted=ANY, count=st.integers(1, 60))
def test_overtaken_counts_each_that_comes_after_a_later_one(wanted: Impairments, count: int):
    way, order = passed(wanted, [FRAME] * count)
    overtaken = sum(number < max(order[:place], default=0) for place, number in enumerate(order))
    assert way.counts.overtaken == overtaken


@given(wanted=ANY, frames=st.lists(st.binary(max_size=300), max_size=30))
def test_wrong_bits_are_counted_to_the_bit(wanted: Impairments, frames: list[bytes]):
    way = Impairment[int](replace(wanted, duplicate=0.0))
    for number, frame in enumerate(frames):
        way.take(frame, 0.0, number)
    wrong = bits = 0
    for one in way.due(float("inf")):
        difference = int.from_bytes(one.octets) ^ int.from_bytes(frames[one.about])
        assert len(one.octets) == len(frames[one.about])
        wrong += difference > 0
        bits += difference.bit_count()
    assert (way.counts.wrong, way.counts.wrong_bits) == (wrong, bits)


def test_nothing_asked_changes_nothing():
    way, order = passed(Impairments(), [FRAME] * 1000)
    assert order == list(range(1000))
    assert way.counts.lost == way.counts.wrong == way.counts.duplicated == 0


def test_a_loss_of_a_tenth_loses_a_tenth():
    way, _ = passed(Impairments(loss=0.1), [b""] * 100_000)
    assert way.counts.lost == 10_021  # number for this seed; three standard deviations are 285


def test_bursts_are_as_long_and_as_frequent_as_gilbert_and_elliott_say():
    # A share of 0.01 / (0.01 + 0.25) = 3.85 % in the bad state, 4 frames at a time.
    way, order = passed(Impairments(burst=Burst(to_bad=0.01, to_good=0.25)), [b""] * 100_000)
    there = set(order)
    starts = sum(number not in there and (number == 0 or number - 1 in there) for number in range(100_000))
    assert way.counts.burst_lost / 100_000 == pytest.approx(0.01 / 0.26, rel=0.1)
    assert way.counts.burst_lost / starts == pytest.approx(4.0, rel=0.05)


def test_wrong_bits_are_as_many_as_asked():
    way, _ = passed(Impairments(bit_errors=1e-3), [FRAME] * 10_000)
    assert way.counts.wrong_bits == pytest.approx(8000, rel=0.04)
    assert way.counts.wrong / 10_000 == pytest.approx(1 - 0.999**800, rel=0.03)


def test_each_comes_after_its_delay_and_within_its_jitter():
    way = Impairment[int](Impairments(delay_s=0.5, jitter_s=0.1))
    way.take(FRAME, 10.0, 0)
    assert not list(way.due(10.499))
    deadline = way.deadline()
    assert deadline is not None
    assert 10.5 <= deadline <= 10.6
    assert [one.about for one in way.due(deadline)] == [0]


def test_what_is_held_back_is_overtaken_by_what_comes_meanwhile():
    wanted = Impairments(reorder=0.2, reorder_s=0.025, seed=3)
    way, order = passed(wanted, [FRAME] * 200)
    held = [number for place, number in enumerate(order) if number < max(order[:place], default=0)]
    assert len(held) == way.counts.overtaken == 39
    for number in held:
        later = [other for other in (number + 1, number + 2, number + 3) if other not in held and other < 200]
        # The second comes 20 ms later, before it, and the third 30 ms.
        assert [order.index(other) < order.index(number) for other in later] == [other < number + 3 for other in later]


def test_a_copy_follows_its_frame():
    way, order = passed(Impairments(duplicate=1.0), [FRAME] * 3)
    assert order == [0, 0, 1, 1, 2, 2]
    assert (way.counts.duplicated, way.counts.overtaken) == (3, 0)


def test_more_on_their_way_than_are_kept_are_counted():
    way = Impairment[int](Impairments(delay_s=1.0), most_waiting=2)
    for number in range(5):
        way.take(FRAME, 0.0, number)
    assert (way.counts.overflow, way.waiting) == (3, 2)
    assert [one.about for one in way.due(1.0)] == [0, 1]


@pytest.mark.parametrize(
    "wanted",
    [{"loss": 1.1}, {"duplicate": -0.1}, {"delay_s": -1.0}, {"burst": Burst(0.1, 2.0)}, {"bit_errors": float("nan")}],
)
def test_what_is_no_share_is_refused(wanted: dict[str, float]):
    with pytest.raises(ConfigurationError, match=r"share out of range|is not in"):
        Impairments(**wanted)  # type: ignore[arg-type]
