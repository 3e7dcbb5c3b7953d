"""Who was heard, when last, and how strongly."""

from firmware.neighbours import Neighbours


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
