"""Neighbours: last reception and signal strength."""

from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from firmware.routing import neighbours as module
from firmware.routing.neighbours import CAPACITY, Neighbours


def test_a_station_heard_twice_is_one_neighbour() -> None:
    neighbours = Neighbours()
    neighbours.heard(b"a", 1.0, None)
    neighbours.heard(b"a", 2.0, None)
    neighbours.heard(b"b", 2.0, None)
    assert neighbours.count(2.0) == 2


def test_a_neighbour_counts_until_the_end_of_the_window_and_not_after() -> None:
    neighbours = Neighbours()
    neighbours.heard(b"a", 10.0, None)
    assert neighbours.count(15.0, within_s=5.0) == 1
    assert neighbours.count(15.001, within_s=5.0) == 0


def test_only_those_inside_the_window_count_however_many_were_heard_before() -> None:
    neighbours = Neighbours()
    for when in range(10):
        neighbours.heard(bytes((when,)), float(when), None)
    assert neighbours.count(9.0, within_s=2.5) == 3


def test_a_signal_below_the_limit_or_unknown_does_not_count() -> None:
    neighbours = Neighbours()
    neighbours.heard(b"strong", 1.0, -60)
    neighbours.heard(b"exact", 1.0, -70)
    neighbours.heard(b"weak", 1.0, -71)
    neighbours.heard(b"unknown", 1.0, None)
    assert neighbours.count(1.0, 5.0, rssi_dbm=-70) == 2
    assert neighbours.count(1.0, 5.0) == 4


def test_the_strength_is_that_of_the_last_sign_of_life() -> None:
    neighbours = Neighbours()
    neighbours.heard(b"a", 1.0, -50)
    neighbours.heard(b"a", 2.0, -90)
    assert neighbours.count(2.0, 5.0, rssi_dbm=-70) == 0


def test_the_longest_silent_is_forgotten_when_the_table_is_full() -> None:
    neighbours = Neighbours(capacity=3)
    for when, who in enumerate([b"a", b"b", b"c", b"a", b"d"]):
        neighbours.heard(who, float(when), -50 if who == b"b" else None)
    assert neighbours.count(4.0, 100.0) == 3
    assert neighbours.count(4.0, 100.0, rssi_dbm=-60) == 0  # b was


def test_a_hundred_thousand_stations_take_no_more_room_than_the_capacity() -> None:
    neighbours = Neighbours(capacity=64)
    for who in range(100_000):
        neighbours.heard(who.to_bytes(4, "big"), who * 1e-3, None)
    assert neighbours.count(100.0, 1e6) == 64


def test_a_full_table_without_a_signal_that_is_good_enough_is_not_walked(monkeypatch: pytest.MonkeyPatch) -> None:
    looked_at: list[float] = []
    newest_first = module.newest_first

    def noting(moments: dict[bytes, float]) -> Iterator[float]:
        for moment in newest_first(moments):
            looked_at.append(moment)
            yield moment

    monkeypatch.setattr(module, "newest_first", noting)
    neighbours = Neighbours()
    for who in range(CAPACITY):
        neighbours.heard(who.to_bytes(4, "big"), 1.0, -95 + who % 20)
    assert neighbours.count(1.0, rssi_dbm=-75) == 0
    assert looked_at == []
    neighbours.heard(b"near", 1.0, -60)
    assert neighbours.count(1.0, rssi_dbm=-75) == 1
    assert neighbours.count(1.0, rssi_dbm=-80, enough=3) == 3
    assert len(looked_at) <= 1 + 3


SIGNS = st.lists(
    st.tuples(st.integers(0, 7).map(lambda who: b"%d" % who), st.floats(0, 3), st.none() | st.integers(-4, 0))
)


@given(SIGNS, st.none() | st.integers(-5, 1), st.integers(1, 6))
def test_what_is_counted_is_what_a_walk_of_all_would_count(
    signs: list[tuple[bytes, float, int | None]], rssi_dbm: int | None, enough: int
) -> None:
    neighbours, walked, now = Neighbours(capacity=5), dict[bytes, tuple[float, int | None]](), 0.0
    for who, later, rssi in signs:
        now += later
        neighbours.heard(who, now, rssi)
        walked.pop(who, None)
        walked[who] = now, rssi
        if len(walked) > 5:
            del walked[next(iter(walked))]
        good = [
            who
            for who, (when, rssi) in walked.items()
            if when >= now - 4.0 and (rssi_dbm is None or (rssi is not None and rssi >= rssi_dbm))
        ]
        assert neighbours.count(now, 4.0, rssi_dbm, enough) == min(len(good), enough)
