"""Duplicate packet detection, EN 302 636-4-1 Annex A.2: per source, bounded, and not for ever."""

from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.wire.geonet_duplicates import LIFETIME, LIST, SOURCES, Duplicates

SOURCE = bytes.fromhex("02000000000b")


def source(number):
    return number.to_bytes(6)


def test_a_number_is_new_once():
    duplicates = Duplicates()
    assert not duplicates.seen(SOURCE, 7, 0.0)
    assert duplicates.seen(SOURCE, 7, 0.1)
    assert duplicates.seen(SOURCE, 7, 0.2)


def test_numbers_may_arrive_in_any_order():
    duplicates = Duplicates()
    assert [duplicates.seen(SOURCE, number, 0.0) for number in (5, 3, 4, 3, 65535, 0, 5)] == [
        False,
        False,
        False,
        True,
        False,
        False,
        True,
    ]


def test_sources_do_not_share_their_numbers():
    duplicates = Duplicates()
    assert not duplicates.seen(source(1), 7, 0.0)
    assert not duplicates.seen(source(2), 7, 0.0)


def test_the_oldest_number_leaves_a_full_list():
    duplicates = Duplicates()
    for number in range(LIST + 1):
        assert not duplicates.seen(SOURCE, number, 0.0)
    assert duplicates.seen(SOURCE, LIST, 0.0)
    assert duplicates.seen(SOURCE, 1, 0.0)
    assert not duplicates.seen(SOURCE, 0, 0.0)


def test_a_source_that_was_silent_for_its_lifetime_is_forgotten():
    duplicates = Duplicates()
    duplicates.seen(SOURCE, 0, 0.0)
    assert duplicates.seen(SOURCE, 0, LIFETIME - 0.1)
    assert duplicates.seen(SOURCE, 0, 2 * LIFETIME - 0.2)  # it was heard in between
    assert not duplicates.seen(SOURCE, 0, 3 * LIFETIME - 0.2)


def test_forged_sources_do_not_fill_the_memory():
    duplicates = Duplicates()
    for number in range(20 * SOURCES):
        duplicates.seen(source(number), 0, 0.0)
    assert len(duplicates) == SOURCES


def test_the_source_silent_for_longest_makes_room():
    duplicates = Duplicates()
    for number in range(SOURCES):
        duplicates.seen(source(number), 0, 0.0)
    assert duplicates.seen(source(0), 0, 0.0)  # heard again: source 1 is now the oldest
    duplicates.seen(source(SOURCES), 0, 0.0)
    assert duplicates.seen(source(0), 0, 0.0)
    assert not duplicates.seen(source(1), 0, 0.0)


@given(numbers=st.lists(st.integers(0, 65535), max_size=50))
@settings(deadline=None, max_examples=200)
def test_a_number_within_the_list_is_a_duplicate_and_no_other(numbers):
    duplicates = Duplicates()
    recent = []
    for number in numbers:
        assert duplicates.seen(SOURCE, number, 0.0) == (number in recent[-LIST:])
        if number not in recent[-LIST:]:
            recent.append(number)
