"""Counters by names that peers choose."""

from firmware.gateway.captain_gateway.captain_gateway.counts import LONGEST_NAME, Tally


def test_each_name_is_counted():
    tally = Tally(2)
    for name in ("a", "b", "a"):
        tally.count(name)
    assert tally.now() == {"a": 2, "b": 1}


def test_names_beyond_so_many_are_counted_together():
    tally = Tally(2)
    for name in ("a", "b", "c", "d", "a"):
        tally.count(name)
    assert tally.now() == {"a": 2, "b": 1, "others": 2}


def test_a_name_of_any_length_takes_no_more_than_its_beginning():
    tally = Tally(2)
    tally.count("a" * 1_000_000)
    assert tally.now() == {"a" * LONGEST_NAME: 1}
