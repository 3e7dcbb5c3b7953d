"""Duplicate packet detection, EN 302 636-4-1 Annex A.2: per source, bounded, limited in time."""

from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.wire.geonet.duplicates import LIFETIME, LIST, PACKETS, SOURCES, Duplicates, Seen

SOURCE = bytes.fromhex("02000000000b")
PAYLOAD = 4711  # hash() of a payload


def source(number):
    return number.to_bytes(6)


def was_seen(duplicates, source, number, now, payload=PAYLOAD):
    """Return True if a packet is dropped as a duplicate."""
    return duplicates.seen(source, number, payload, now) is Seen.AGAIN


def test_a_number_is_new_once():
    duplicates = Duplicates()
    assert not was_seen(duplicates, SOURCE, 7, 0.0)
    assert was_seen(duplicates, SOURCE, 7, 0.1)
    assert was_seen(duplicates, SOURCE, 7, 0.2)


def test_numbers_may_arrive_in_any_order():
    duplicates = Duplicates()
    assert [was_seen(duplicates, SOURCE, number, 0.0) for number in (5, 3, 4, 3, 65535, 0, 5)] == [
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
    assert not was_seen(duplicates, source(1), 7, 0.0)
    assert not was_seen(duplicates, source(2), 7, 0.0)


def test_the_oldest_number_leaves_a_full_list():
    duplicates = Duplicates()
    for number in range(LIST + 1):
        assert not was_seen(duplicates, SOURCE, number, 0.0)
    assert was_seen(duplicates, SOURCE, LIST, 0.0)
    assert was_seen(duplicates, SOURCE, 1, 0.0)
    assert not was_seen(duplicates, SOURCE, 0, 0.0)


def test_a_source_that_was_silent_for_its_lifetime_is_forgotten():
    duplicates = Duplicates()
    was_seen(duplicates, SOURCE, 0, 0.0)
    assert was_seen(duplicates, SOURCE, 0, LIFETIME - 0.1)
    assert was_seen(duplicates, SOURCE, 0, 2 * LIFETIME - 0.2)  # it was heard in between
    assert not was_seen(duplicates, SOURCE, 0, 3 * LIFETIME - 0.2)


def test_forged_sources_do_not_fill_the_memory():
    duplicates = Duplicates()
    for number in range(20 * SOURCES):
        was_seen(duplicates, source(number), 0, 0.0)
    assert len(duplicates) == SOURCES


def test_the_source_silent_for_longest_makes_room():
    duplicates = Duplicates()
    for number in range(SOURCES):
        was_seen(duplicates, source(number), 0, 0.0)
    assert was_seen(duplicates, source(0), 0, 0.0)  # heard again: source 1 is now the oldest
    was_seen(duplicates, source(SOURCES), 0, 0.0)
    assert was_seen(duplicates, source(0), 0, 0.0)
    assert not was_seen(duplicates, source(1), 0, 0.0)


@given(numbers=st.lists(st.integers(0, 65535), max_size=50))
@settings(deadline=None, max_examples=200)
def test_a_number_within_the_list_is_a_duplicate_and_no_other(numbers):
    duplicates = Duplicates()
    recent = []
    for number in numbers:
        assert was_seen(duplicates, SOURCE, number, 0.0) == (number in recent[-LIST:])
        if number not in recent[-LIST:]:
            recent.append(number)


def test_another_packet_with_a_known_number_is_told_apart_and_is_new_once():
    duplicates = Duplicates()
    assert duplicates.seen(SOURCE, 7, PAYLOAD, 0.0) is Seen.NEW
    assert duplicates.seen(SOURCE, 7, PAYLOAD + 1, 0.0) is Seen.OTHER
    assert duplicates.seen(SOURCE, 7, PAYLOAD + 1, 0.0) is Seen.AGAIN
    assert duplicates.seen(SOURCE, 7, PAYLOAD, 0.0) is Seen.AGAIN


def test_many_packets_with_one_number_do_not_fill_the_memory_and_the_last_are_known():
    duplicates = Duplicates()
    for payload in range(1000):
        duplicates.seen(SOURCE, 7, payload, 0.0)
    assert duplicates.seen(SOURCE, 7, 1000 - PACKETS, 0.0) is Seen.AGAIN
    assert duplicates.seen(SOURCE, 7, 0, 0.0) is Seen.OTHER
